"""The running standard deviation of intrinsic returns, by which intrinsic rewards are divided."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torchrl.envs.transforms.rnd import RunningMeanStd


class ReturnScale:
    """Standard deviation of the discounted sums of past intrinsic rewards.

    For each agent the sum is ``s <- gamma * s + r`` at every step, across the ends of episodes
    (Burda et al. 2019, "Exploration by random network distillation", section 2.4 and their code).
    TorchRL's `RNDTransform` divides by the deviation of single rewards instead, which depends on
    the time between novel observations.

    Args:
        gamma: Discount.
    """

    def __init__(self, gamma: float) -> None:
        self._gamma = gamma
        self._statistics = RunningMeanStd()
        self._sums = torch.zeros(0)

    def update(self, rewards: Tensor, counted: Tensor) -> None:
        """Add the rewards of one batch.

        Args:
            rewards: ``(worlds, steps, agents)``.
            counted: The same shape, True for rewards that count.
        """
        if self._sums.shape != rewards[:, 0].shape:
            self._sums = torch.zeros_like(rewards[:, 0])
        sums = []
        for step in rewards.unbind(1):
            self._sums = self._gamma * self._sums + step
            sums.append(self._sums)
        values = torch.stack(sums, dim=1)[counted]
        if values.numel():
            self._statistics.update(values)

    @property
    def scale(self) -> float:
        """The standard deviation, at least 1e-4."""
        return float(self._statistics.var.clamp_min(1e-8).sqrt())

    def state_dict(self) -> dict[str, Any]:
        """Return statistics and sums."""
        return {"statistics": self._statistics.state_dict(), "sums": self._sums}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self._statistics.load_state_dict(state["statistics"])
        self._sums = state["sums"].cpu()
