"""Actions and log-probabilities from the parameters of their distributions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.distributions import Categorical
from torch.nn.functional import softplus

from veca_marl.algos.acting.keys import Arrays, Key

Draw = Callable[..., tuple[Tensor, Tensor]]

_LOG_ROOT_2_PI = math.log(math.sqrt(2.0 * math.pi))
_LOG_2 = math.log(2.0)


@dataclass(frozen=True)
class DrawnPart:
    """A part of an action.

    Attributes:
        draw: Returns action and log-probability; its arguments are whether to sample, and the
            parameters of the distribution.
        parameters: Keys of the parameters.
        action: Key of the action.
        log_prob: Key of its log-probability.
    """

    draw: Draw
    parameters: tuple[Key, ...]
    action: Key
    log_prob: Key

    def write(self, arrays: Arrays, sampled: bool) -> None:
        """Write action and log-probability."""
        parameters = (arrays[key] for key in self.parameters)
        arrays[self.action], arrays[self.log_prob] = self.draw(sampled, *parameters)


def draw_tanh_normal(sampled: bool, loc: Tensor, scale: Tensor) -> tuple[Tensor, Tensor]:
    """Return action ``(..., A)`` in (-1, 1) and log-probability ``(...)``.

    These are the operations of TorchRL's `TanhNormal` on [-1, 1] in their order: the same seed
    gives the same bits. Making that object and calling its transforms takes four times as long.

    Args:
        sampled: Whether to sample; otherwise the action is tanh(loc).
        loc: Mean of the normal distribution before tanh, ``(..., A)``.
        scale: Its standard deviation.
    """
    limit = 1.0 - torch.finfo(loc.dtype).resolution
    noise = torch.normal(torch.zeros_like(loc), torch.ones_like(loc)) if sampled else None
    action = (loc if noise is None else loc + noise * scale).tanh().clamp(-limit, limit)
    normal = action.atanh()  # from the action as it is stored, as a loss computes it
    density = -((normal - loc) ** 2) / (2 * scale**2) - scale.log() - _LOG_ROOT_2_PI
    jacobian = 2.0 * (_LOG_2 - normal - softplus(-2.0 * normal))
    return action, density.sum(-1) - jacobian.sum(-1)


def draw_categorical(sampled: bool, logits: Tensor) -> tuple[Tensor, Tensor]:
    """Return choice ``(...)`` int64 and log-probability ``(...)``.

    Args:
        sampled: Whether to sample; otherwise it is the most likely choice.
        logits: ``(..., choices)``.
    """
    distribution = Categorical(logits=logits, validate_args=False)
    choice = distribution.sample() if sampled else distribution.mode
    return choice, distribution.log_prob(choice)
