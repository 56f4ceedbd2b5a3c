"""Windows of some steps from a replay buffer, and their n-step returns."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor


@dataclass(frozen=True)
class Windows:
    """Some consecutive steps of each of B places in a replay buffer.

    Attributes:
        first: Rows ``(B,)``: observation, mask and action of the first step.
        last: Rows ``(B,)``: observation and mask after the last step.
        reward: ``(B, steps, agents)``.
        terminated: ``(B, steps, agents)``.
        took_place: ``(B, steps)``, False for steps after the end of an episode or a batch.
    """

    first: TensorDictBase
    last: TensorDictBase
    reward: Tensor
    terminated: Tensor
    took_place: Tensor


@dataclass(frozen=True)
class Transitions:
    """What one update learns from.

    Attributes:
        first: Rows ``(B,)``, see `Windows`.
        last: Rows ``(B,)``, see `Windows`.
        returns: Discounted sum of the rewards of the window, ``(B, agents)``.
        discount: Factor of the value of `last`, ``(B, agents)``: 0 if the agent's episode was
            terminated in the window.
        counted: ``(B, agents)``, True for entries to learn from: agents that are present, in
            windows with at least one step.
    """

    first: TensorDictBase
    last: TensorDictBase
    returns: Tensor
    discount: Tensor
    counted: Tensor

    def to(self, device: torch.device) -> Transitions:
        """Return the same on `device`."""
        return Transitions(**{name: array.to(device) for name, array in vars(self).items()})


def transitions(windows: Windows, team: str, gamma: float) -> Transitions:
    """Return what is learnt from `windows`.

    Args:
        windows: The windows.
        team: Name of the team.
        gamma: Discount of one step.
    """
    took_place = windows.took_place.unsqueeze(-1)
    factor = torch.where(took_place, gamma, 1.0) * ~(windows.terminated & took_place)
    before = torch.cat([torch.ones_like(factor[:, :1]), factor[:, :-1]], 1).cumprod(1)
    present = took_place[:, 0].expand_as(windows.reward[:, 0])
    mask = windows.first[team].get("mask", None)
    return Transitions(
        first=windows.first,
        last=windows.last,
        returns=(before * windows.reward * took_place).sum(1),
        discount=factor.prod(1),
        counted=present if mask is None else present & mask,
    )
