"""The evaluations of a training run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from torchrl import timeit

from veca_marl.algos.evaluation.evaluate import EvalCfg, Scores
from veca_marl.algos.evaluation.evaluators import Evaluator, Request, nothing
from veca_marl.algos.seeds import derived_seed
from veca_marl.algos.training.finite import check_scores

_EVALUATION_STAGE = 2**31 - 1  # in place of a stage number: seeds that no training stage uses


def evaluation_seed(seed: int) -> int:
    """Return the seed of the episodes of all evaluations of a run with the seed `seed`."""
    return derived_seed(seed, _EVALUATION_STAGE)


@dataclass(frozen=True)
class Evaluations:
    """Plays the evaluations of a run; all of them begin with the same episodes.

    Each method returns the scores of each team, and raises `NotFiniteError` if one is not finite.

    Attributes:
        evaluator: Plays the episodes.
        cfg: Numbers of episodes, and whether actions are sampled.
        seed: Seed of the run.
    """

    evaluator: Evaluator
    cfg: EvalCfg
    seed: int

    def play_baseline(self) -> dict[str, Scores]:
        """Play the episodes of the last evaluation with random actions."""
        return self._play("random", self.cfg.last_episodes)

    def play(self) -> dict[str, Scores]:
        """Play the evaluation of the policy after a stage that is not the last."""
        return self._play("policy", self.cfg.episodes)

    def play_last(self, meanwhile: Callable[[], None]) -> dict[str, Scores]:
        """Play the last evaluation of the policy; call `meanwhile` once, see `Evaluator`."""
        return self._play("policy", self.cfg.last_episodes, meanwhile)

    def _play(
        self, player: str, episodes: int, meanwhile: Callable[[], None] = nothing
    ) -> dict[str, Scores]:
        request = Request(player, episodes, evaluation_seed(self.seed), self.cfg.exploration)
        with timeit("evaluate"):
            scores = self.evaluator.play(request, meanwhile)
        check_scores(scores)
        return scores
