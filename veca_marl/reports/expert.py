"""The expert as a baseline: its evaluation on the game of an experiment."""

from __future__ import annotations

from contextlib import closing

from veca_marl.algos.evaluation.comparison import score_rows
from veca_marl.algos.evaluation.evaluate import Exploration, evaluate
from veca_marl.algos.training.evaluations import evaluation_seed
from veca_marl.config import Config
from veca_marl.envs.adapters.torchrl import ExpertPolicy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import has_expert
from veca_marl.reports.gather import Row


def expert_rows(cfg: Config, arm: str, episodes: int) -> list[Row]:
    """Return the evaluation of the expert as rows of a table of results.

    All teams that learn are played by the expert; the others have their opponents. The episodes are
    those in which a run with the seed of the arm is evaluated.

    Args:
        cfg: Configuration of an arm.
        arm: Its name.
        episodes: Number of episodes; 0 plays none.

    Returns:
        A row for each team; none if the task has no expert or an opponent is another run.
    """
    if episodes == 0 or not has_expert(cfg.task.name) or cfg.frozen:
        return []
    seed = evaluation_seed(cfg.seed)
    with closing(VecaEnv(cfg.game, min(episodes, cfg.eval.worlds), seed)) as env:
        scores = evaluate(env, ExpertPolicy(env), episodes, seed, Exploration.deterministic)
    head = {"arm": arm, "seed": str(cfg.seed), "state": "finished", "frames": "0"}
    return [
        head | {name: _cell(value) for name, value in row.items()}
        for row in score_rows("expert", scores)
    ]


def _cell(value: float | int | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
