"""Windows of some steps from a replay buffer, and their n-step returns."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor


@dataclass(frozen=True)
class Transitions:
    """What one update learns from.

    Attributes:
        first: Rows ``(B,)``: observation, action and mask of the first step of each window.
        last: Rows ``(B,)``: observation and mask after the last step of each window.
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


def transitions(windows: TensorDictBase, team: str, gamma: float) -> Transitions:
    """Return what is learnt from `windows`.

    Args:
        windows: ``(B, steps + 1)`` consecutive rows with ``"validity_mask"``; rows after the end of
            a segment repeat its last row and are not valid.
        team: Name of the team.
        gamma: Discount of one step.
    """
    took_place = windows["validity_mask"][:, 1:].unsqueeze(-1)  # step j leads to row j + 1
    reward = windows[team, "reward"][:, :-1].squeeze(-1)
    terminated = windows[team, "terminated"][:, :-1].squeeze(-1) & took_place
    factor = torch.where(took_place, gamma, 1.0) * ~terminated
    before = torch.cat([torch.ones_like(factor[:, :1]), factor[:, :-1]], 1).cumprod(1)
    first, last = windows[:, 0], windows[:, -1]
    counted = took_place[:, 0].expand_as(reward[:, 0])
    mask = first[team].get("mask", None)
    return Transitions(
        first=first,
        last=last,
        returns=(before * reward * took_place).sum(1),
        discount=factor.prod(1),
        counted=counted if mask is None else counted & mask,
    )
