"""Whether the same seed gives the same bytes, and another seed others."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np

from veca_marl.checks.findings import Finding, finding
from veca_marl.envs.core.actions import random_action
from veca_marl.envs.core.benchmark import start_state
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game

NAMES = ("seeding",)


def check_seeding(used: Game, new: Game, steps: int, seed: int) -> Iterator[Finding]:
    """Play the same random actions several times and compare observations and rewards.

    Args:
        used: A game; it plays another episode before it is compared.
        new: A game that was just built.
        steps: Number of steps of each rollout.
        seed: Seed of episodes and actions.

    Yields:
        ``seeding``: the rollout has the same bytes in a new and in a used world, and another seed
        starts another episode.
    """
    problems = []
    first = digest(used, steps, seed)
    other = _start(used, seed + 1)
    if digest(used, steps, seed) != first:
        problems.append("the same seed gives other bytes in a world that was used before")
    if digest(new, steps, seed) != first:
        problems.append("the same seed gives other bytes in a new world")
    if _start(used, seed) == other:
        problems.append(f"the seeds {seed} and {seed + 1} give the same start")
    yield finding("seeding", problems, f"{steps} steps have equal bytes in a new and a used world")


def digest(game: Game, steps: int, seed: int) -> str:
    """Return a hash of poses, observations, terms and flags of a rollout of random actions."""
    total, episodes, rng, done = hashlib.sha256(), Episodes(seed), np.random.default_rng(seed), True
    for _ in range(steps):
        if done:
            game.reset(episodes.next())
            _add_observations(total, game)
        outcome = game.step({p.name: random_action(p.body.action_spec, rng) for p in game.actors})
        done = outcome.done
        _add_observations(total, game)
        total.update(repr((outcome.terms, done, sorted(outcome.eliminated))).encode())
    return total.hexdigest()


def _start(game: Game, seed: int) -> str:
    """Return a hash of the start of the first episode; no action has an effect on it."""
    total = hashlib.sha256()
    game.reset(Episodes(seed).next())
    _add_observations(total, game)
    return total.hexdigest()


def _add_observations(total: hashlib._Hash, game: Game) -> None:
    """Add the poses, which senses need not show, and the observations."""
    total.update(start_state(game).tobytes())
    for player in game.actors:
        for key, array in sorted(game.observe(player).items()):
            total.update(key.encode())
            total.update(np.ascontiguousarray(array).tobytes())
