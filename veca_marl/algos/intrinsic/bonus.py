"""The intrinsic rewards of one team, normalised and added to those of the task."""

from __future__ import annotations

import math
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs.transforms.rnd import RunningMeanStd

from veca_marl.algos.intrinsic.intrinsic_reward import IntrinsicCfg, make_intrinsic
from veca_marl.algos.intrinsic.prediction import counted_steps
from veca_marl.algos.specs import TeamSpec


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


TERM = "intrinsic_return"  # under (team, "info"): it is summed over episodes as reward terms are


class Bonus:
    """Computes the intrinsic rewards of a team and adds them to the rewards that it learns from.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: Which intrinsic reward.
        device: Where its model learns.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: IntrinsicCfg, device: torch.device) -> None:
        self.team, self.cfg = team, cfg
        self.source = make_intrinsic(team, spec, cfg, device)
        self.scale = ReturnScale(cfg.gamma)

    def add(self, batch: TensorDictBase) -> tuple[TensorDictBase, dict[str, float]]:
        """Return what the algorithm learns from, and what was measured.

        The normalised intrinsic rewards are written into `batch` under
        ``("next", team, "info", "intrinsic_return")``; its rewards stay those of the task.

        Args:
            batch: Experience ``(worlds, steps)``.

        Returns:
            A copy of `batch` with task reward + coefficient * intrinsic reward, which shares all
            other tensors; and the measures of the model.
        """
        rewards, measured = self.source.learn(batch)
        self.scale.update(rewards.squeeze(-1), counted_steps(batch, self.team))
        rewards = rewards / self.scale.scale
        self._write(batch, rewards)
        mixed = batch.copy()
        mixed["next", self.team, "reward"] = (
            batch["next", self.team, "reward"] + self.cfg.coefficient * rewards
        )
        return mixed, measured | {"intrinsic_scale": self.scale.scale}

    def idle(self, batch: TensorDictBase) -> dict[str, float]:
        """Mark a batch that the team does not learn from: all numbers are not a number."""
        self._write(batch, torch.full_like(batch["next", self.team, "reward"], math.nan))
        return dict.fromkeys([*self.source.measures, "intrinsic_scale"], math.nan)

    def _write(self, batch: TensorDictBase, rewards: torch.Tensor) -> None:
        step = batch["next", self.team]
        if "info" not in step.keys():  # noqa: SIM118  a TensorDict
            step["info"] = TensorDict({}, step.batch_size)
        step["info", TERM] = rewards

    def state_dict(self) -> dict[str, Any]:
        """Return tensors and plain data from which `load_state_dict` continues exactly."""
        return {"source": self.source.state_dict(), "scale": self.scale.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.source.load_state_dict(state["source"])
        self.scale.load_state_dict(state["scale"])
