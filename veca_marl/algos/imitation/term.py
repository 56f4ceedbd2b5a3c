"""A term of imitation in the loss of another algorithm, which fades while it learns.

Source: Rajeswaran et al. 2018, "Learning complex dexterous manipulation with deep reinforcement
learning and demonstrations" (DAPG), whose weight falls geometrically; ours falls linearly to zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torch.distributions import Distribution
from torchrl.modules import set_recurrent_mode

from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.imitation.loss import ImitationLoss
from veca_marl.algos.imitation.samples import COUNTED, Samples, SequenceCfg
from veca_marl.algos.specs import TeamSpec


@dataclass
class ImitationCfg:
    """Numbers of a term of imitation; all of them are ours. Used with ``demonstrations=FOLDER``.

    Attributes:
        coefficient: Weight of the term at the start, beside the loss of the policy; 0 for none.
        frames: Frames over which the weight falls to 0.
        batch_size: Demonstrated steps in each update.
        burn_in: See `BCCfg`.
        least_scale: See `BCCfg`.
    """

    coefficient: float = 0.3
    frames: int = 60_000
    batch_size: int = 64
    burn_in: int = 16
    least_scale: float = 0.2

    def __post_init__(self) -> None:
        if not 0.0 <= self.coefficient < math.inf:
            raise ValueError(
                f"imitation.coefficient must be finite, 0 or more, got {self.coefficient}"
            )
        for name in ("frames", "batch_size"):
            if getattr(self, name) < 1:
                raise ValueError(f"imitation.{name} must be at least 1, got {getattr(self, name)}")
        if self.burn_in < 0:
            raise ValueError(f"imitation.burn_in must be 0 or more, got {self.burn_in}")
        if not 0.0 < self.least_scale < math.inf:
            raise ValueError(
                f"imitation.least_scale must be positive and finite, got {self.least_scale}"
            )


class ImitationTerm:
    """The term for one team; without demonstrations there is none.

    Args:
        team: Name of the team.
        spec: Its arrays.
        actor: Its policy.
        cfg: The numbers.
        steps: Consecutive steps of a sequence, for a policy with hidden state.
        policy_of: Returns the distribution of the policy in a sample; None asks `actor`.
    """

    def __init__(
        self,
        team: str,
        spec: TeamSpec,
        actor: TensorDictModuleBase,
        cfg: ImitationCfg,
        steps: int,
        policy_of: Callable[[TensorDictBase], Distribution] | None = None,
    ) -> None:
        self.cfg, self.frames = cfg, 0
        self._team, self._spec, self._actor, self._steps = team, spec, actor, steps
        self._policy_of = policy_of or self._of_actor
        self._loss = ImitationLoss(team, spec.actions, cfg.least_scale)
        self._samples: Samples | None = None
        self._last = math.nan

    def take(self, demonstrations: Demonstrations) -> None:
        """Draw from demonstrations from now on."""
        self._samples = Samples(
            demonstrations,
            self._team,
            self._spec,
            self._actor,
            SequenceCfg(self.cfg.burn_in, self._steps),
            range(len(demonstrations)),
        )

    @property
    def active(self) -> bool:
        """Whether there are demonstrations."""
        return self._samples is not None

    @property
    def weight(self) -> float:
        """The present weight of the term."""
        if self._samples is None:
            return 0.0
        return self.cfg.coefficient * max(0.0, 1.0 - self.frames / self.cfg.frames)

    def loss(self, device: torch.device) -> Tensor:
        """Return the weighted loss of a sample; 0 where the weight is 0."""
        if self._samples is None or self.weight == 0.0:
            return torch.zeros((), device=device)
        rows = self._samples.draw(self.cfg.batch_size).to(device)
        with set_recurrent_mode(True):
            policy = self._policy_of(rows)
        imitated = self._loss(policy, rows, rows[COUNTED])
        self._last = float(imitated.loss.detach())
        return self.weight * imitated.loss

    def _of_actor(self, rows: TensorDictBase) -> Distribution:
        found: Distribution = self._actor.get_dist(rows.select(*self._actor.in_keys, strict=False))
        return found

    @property
    def measures(self) -> dict[str, float]:
        """What is logged: the last loss and the weight; nothing without demonstrations."""
        if not self.active:
            return {}
        return {"imitation_loss": self._last, "imitation_weight": self.weight}

    def state_dict(self) -> dict[str, Any]:
        """Return the frames so far."""
        return {"frames": self.frames}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        self.frames = int(state["frames"])
