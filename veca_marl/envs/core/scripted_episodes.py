"""Whole episodes in which scripts choose the actions of all players."""

from __future__ import annotations

from collections.abc import Iterator

from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.task import Player
from veca_marl.envs.core.team import Script


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
