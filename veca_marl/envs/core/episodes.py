"""Episodes: where the randomness of each comes from, and whole ones that scripts play."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import SupportsIndex

import numpy as np

from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.task import Player


def fresh_seed() -> int:
    """Return a seed of 128 bits drawn from the operating system's entropy."""
    entropy = np.random.SeedSequence().entropy
    assert isinstance(entropy, int)  # what numpy draws when it is given no entropy
    return entropy


def check_integer(name: str, value: SupportsIndex, least: int = 0) -> int:
    """Return an integer that is at least `least`.

    Raises:
        ValueError: If it is another value; the message begins with its name.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name}={value!r} must be an integer") from None
    if number < least:
        raise ValueError(f"{name}={number} must be {least} or more")
    return number


class Episodes:
    """Generators for the episodes of one world, in their order.

    The generator of an episode depends on the seed, the number of the world and the number of the
    episode alone. What happened in earlier episodes has no influence: two policies that draw
    different amounts of randomness while they play start later episodes alike.

    Attributes:
        seed: The seed in use; drawn from the operating system if none was given.
        number: The number of the episode that the next call of `next` begins.

    Args:
        seed: 0 or more; None is fresh entropy.
        world: Number of the world, 0 or more.

    Raises:
        ValueError: If `seed` or `world` is negative or no integer.
    """

    def __init__(self, seed: int | None = None, world: int = 0) -> None:
        check_integer("world", world)
        self.seed = fresh_seed() if seed is None else check_integer("seed", seed)
        self.number = 0
        self._world = world

    @property
    def state(self) -> tuple[int, int, int]:
        """Seed, number of the world, and number of the next episode."""
        return self.seed, self._world, self.number

    @staticmethod
    def at(state: tuple[int, int, int]) -> Episodes:
        """Return episodes that continue at a `state`."""
        seed, world, number = state
        episodes = Episodes(seed, world)
        episodes.number = check_integer("episode", number)
        return episodes

    def next(self, number: int | None = None) -> np.random.Generator:
        """Return the generator of the next episode.

        Args:
            number: Continue with the episode of this number, 0 or more; None is the one after the
                last.

        Raises:
            ValueError: If `number` is negative or no integer.
        """
        if number is not None:
            self.number = check_integer("episode", number)
        rng = np.random.default_rng([self.seed, self._world, self.number])
        self.number += 1
        return rng


def first_team(game: Game) -> list[Player]:
    """Return the players of the first team that is not scripted by the configuration."""
    return [player for player in game.actors if player.team == game.actors[0].team]


def play_to_end(game: Game, script: Script) -> Iterator[Outcome]:
    """Play a game that has just been reset and yield the outcome of each step until it is done.

    Args:
        game: The game; teams that its configuration scripts keep their scripts.
        script: Chooses the actions of the first team; players of other teams act at random.
    """
    team, done = first_team(game), False
    while not done:
        for player in game.actors:
            game.play_script(player, script if player in team else Script.random)
        outcome = game.advance()
        done = outcome.done
        yield outcome
