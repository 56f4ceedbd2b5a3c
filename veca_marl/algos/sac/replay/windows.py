"""Windows of some steps from a replay buffer, and their n-step returns."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor

VALID = "valid"  # False for rows of a window before the start or after the end of its segment


@dataclass(frozen=True)
class Span:
    """Consecutive rows of a window: ``burn_in``, then ``length``, then ``steps``.

    Attributes:
        burn_in: Rows from which only the hidden state is computed.
        length: Steps that are learnt from.
        steps: Rewards in the target of each of them.
    """

    burn_in: int
    length: int
    steps: int

    @property
    def learnt(self) -> slice:
        """Rows of the steps that are learnt from."""
        return slice(self.burn_in, self.burn_in + self.length)

    @property
    def following(self) -> slice:
        """Rows of the observations after the rewards of each of them."""
        return slice(self.burn_in + self.steps, self.burn_in + self.steps + self.length)

    def targets(self, rows: Tensor) -> Tensor:
        """Return the rewards of each target, ``(windows * length, steps, ...)``.

        Args:
            rows: Something of each step of windows, ``(windows, rows - 1, ...)``.
        """
        return rows[:, self.burn_in :].unfold(1, self.steps, 1).flatten(0, 1)


@dataclass(frozen=True)
class Windows:
    """What was drawn from a replay buffer for B targets.

    Attributes:
        first: Rows ``(B,)``: observation, mask and action of the first step of a target.
        last: Rows ``(B,)``: observation and mask after its last step.
        reward: ``(B, steps, agents)``.
        terminated: ``(B, steps, agents)``.
        took_place: ``(B, steps)``, False for steps after the end of an episode or a batch.
        sequences: For networks with hidden state: all rows of the windows ``(windows, rows)`` with
            observation, mask, hidden state, ``is_init`` and `VALID`; `first` and `last` have no
            observations then. B is the number of windows times ``span.length``.
    """

    first: TensorDictBase
    last: TensorDictBase
    reward: Tensor
    terminated: Tensor
    took_place: Tensor
    sequences: TensorDictBase | None = None

    @property
    def observed(self) -> tuple[TensorDictBase, ...]:
        """Rows with observations, each of batch size ``(windows, ...)``."""
        return (self.first, self.last) if self.sequences is None else (self.sequences,)


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
        sequences: See `Windows`.
    """

    first: TensorDictBase
    last: TensorDictBase
    returns: Tensor
    discount: Tensor
    counted: Tensor
    sequences: TensorDictBase | None = None

    def to(self, device: torch.device) -> Transitions:
        """Return the same on `device`."""
        present = {name: array for name, array in vars(self).items() if array is not None}
        return Transitions(**{name: array.to(device) for name, array in present.items()})


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
        sequences=windows.sequences,
    )
