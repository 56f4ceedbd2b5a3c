"""The expert as a baseline: its evaluation on the game of an experiment."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

from veca_marl.algos.evaluation.comparison import score_rows
from veca_marl.algos.evaluation.evaluate import Exploration, evaluate
from veca_marl.algos.training.evaluations import evaluation_seed
from veca_marl.envs.adapters.torchrl import ExpertPolicy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import find_expert, has_expert, missing_needs
from veca_marl.reports.arms import Arm
from veca_marl.reports.gather import Row


def expert_rows(arms: Sequence[Arm], episodes: int) -> list[Row]:
    """Return the evaluation of the expert as rows of a table of results.

    All teams that learn are played by the expert; the others have their opponents. The episodes are
    those in which a run with the seed of the arm is evaluated.

    Args:
        arms: The arms; the first one counts in which the expert has the senses and the control rate
            that it needs.
        episodes: Number of episodes; 0 plays none.

    Returns:
        A row for each team; none if the task has no expert or an opponent is another run.
    """
    for arm in arms if episodes else ():
        if has_expert(arm.cfg.task.name) and not arm.cfg.frozen:
            rows = _rows_of(arm, episodes)
            if rows:
                return rows
    return []


def _rows_of(arm: Arm, episodes: int) -> list[Row]:
    """Return the rows of one arm; none if its players lack what the expert needs."""
    cfg, seed = arm.cfg, evaluation_seed(arm.cfg.seed)
    expert = find_expert(cfg.task.name)
    with closing(VecaEnv(cfg.game, min(episodes, cfg.eval.worlds), seed)) as env:
        game = env.games[0]
        if any(missing_needs(expert, player, game.world.clock) for player in game.actors):
            return []
        scores = evaluate(env, ExpertPolicy(env), episodes, seed, Exploration.deterministic)
    head = {"arm": arm.name, "seed": str(cfg.seed), "state": "finished", "frames": "0"}
    return [
        head | {name: _cell(value) for name, value in row.items()}
        for row in score_rows("expert", scores)
    ]


def _cell(value: float | int | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
