"""Returns of simple policies without learning against a random defender in SoccerTwoPlayer.

python experiments/soccer/baselines.py                                   # as in the experiment
python experiments/soccer/baselines.py 'task.weights={goal: 5.0}'        # Hydra overrides
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.locomotion import walk_to

EPISODES = 48
Command = tuple[float, float]  # speed ahead and turning rate, as shares of the greatest


def stand(game: Game, attacker: Player) -> Command:
    """Do nothing."""
    return 0.0, 0.0


def straight(game: Game, attacker: Player) -> Command:
    """Walk forwards."""
    return 1.0, 0.0


def chase(game: Game, attacker: Player) -> Command:
    """Walk to the ball and through it."""
    return walk_to(attacker.body, game.task.ball.position)


PLAYS: dict[str, Script | Callable[[Game, Player], Command]] = {
    "random": Script.random,
    "stand": stand,
    "straight": straight,
    "chase": chase,
    "expert": Script.expert,
}


def episode(game: Game, play: Script | Callable[[Game, Player], Command], seed: int) -> Any:
    """Play one episode; return the attacker's return and whether it scored."""
    rng = np.random.default_rng([2026, seed])
    game.reset(rng)
    attacker, defender = game.players
    total = 0.0
    while True:
        if isinstance(play, Script):
            game.play_script(attacker, play)
        else:
            attacker.body.act(attacker.body.encode(play(game, attacker)))
        game.play_script(defender, Script.random)
        outcome = game.advance()
        total += game.reward_of(outcome.terms[attacker.name])
        if outcome.done:
            return total, outcome.terminated


def main() -> None:
    """Print one line per policy."""
    overrides = ["+experiment=soccer", "senses/vision=blind", "senses/touch=numb", *sys.argv[1:]]
    game = Game(compose(overrides).game)
    for name, play in PLAYS.items():
        total, scored = np.transpose([episode(game, play, seed) for seed in range(EPISODES)])
        interval = 1.96 * total.std(ddof=1) / EPISODES**0.5
        print(f"{name:9}return {total.mean():6.2f} +- {interval:.2f}, goals {scored.mean():4.0%}")
    game.close()


if __name__ == "__main__":
    main()
