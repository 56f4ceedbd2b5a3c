"""The loss of imitation: how unlikely a policy finds what the demonstrator did.

TorchRL's `BCLoss` learns from one key: it compares a sample of the policy with the action by the
squared error unless the keys ``loc`` or ``logits`` are at the root, where a team's are not, and
knows neither actions of several parts nor agents that are absent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import CompositeDistribution
from torch import Tensor
from torch.distributions import Distribution, Normal

from veca_marl.algos.demonstration_files import Key
from veca_marl.algos.networks.mixture import TanhNormalMixture
from veca_marl.algos.specs import ActionLayout, action_key

LARGEST_ACTION = 0.98
"""Magnitude to which demonstrated numbers are limited.

Those at the ends of [-1, 1] are infinitely far for a normal distribution before tanh.
"""


@dataclass(frozen=True)
class Imitated:
    """The loss of a sample, and what is measured.

    Attributes:
        loss: Mean of the cross entropy in nats for each dimension of the action.
        error: Mean absolute error of the most likely action, of continuous parts; not a number
            without any.
        agreement: Fraction of choices that are the most likely ones; not a number without any.
    """

    loss: Tensor
    error: Tensor
    agreement: Tensor


class ImitationLoss:
    """The cross entropy of a policy with demonstrated actions, for actions of any form.

    For a vector, the demonstration is a normal distribution before tanh: its mean is the
    demonstrated action, its standard deviation `least_scale`. The loss of a policy with the mean
    squared error ``e`` is smallest at the scale ``sqrt(e + least_scale ** 2)``. With the
    likelihood of the demonstrated action alone, the scale of a policy that repeats a deterministic
    expert would shrink to zero: nothing could be explored from it, and gradients would grow with
    the inverse square. For a mixture with the weights ``w`` and the cross entropies ``h`` of its
    normal distributions, the loss is ``-log(sum(w * exp(-h)))``: by Jensen's inequality an upper
    bound of its cross entropy.

    Args:
        team: Name of the team.
        actions: Part of the action to its layout.
        least_scale: Standard deviation of a demonstration before tanh: the scale of a policy
            without errors.
        labels: Part of the action to the key of what was demonstrated; None is that of the action.
    """

    def __init__(
        self,
        team: str,
        actions: Mapping[str, ActionLayout],
        least_scale: float,
        labels: Mapping[str, Key] | None = None,
    ) -> None:
        self._actions, self._least = dict(actions), least_scale
        self._keys = {part: action_key(team, part) for part in actions}
        self._labels = dict(labels or self._keys)
        self._dimensions = sum(layout.dimensions for layout in actions.values())

    def __call__(self, policy: Distribution, rows: TensorDictBase, counted: Tensor) -> Imitated:
        """Return the loss of a sample.

        Args:
            policy: The distribution of the policy in the rows.
            rows: The sample, with what was demonstrated.
            counted: ``(..., agents)``, True for entries that count.
        """
        losses, errors, agreements = [], [], []
        for part, layout in self._actions.items():
            distribution, shown = self._part(policy, part), rows[self._labels[part]]
            if layout.discrete:
                losses.append(-distribution.log_prob(shown))
                agreements.append((distribution.logits.argmax(-1) == shown).float())
            else:
                losses.append(self._of_vector(distribution, shown))
                errors.append((distribution.deterministic_sample - shown).abs().mean(-1).detach())
        total = torch.stack(losses).sum(0) / self._dimensions
        return Imitated(
            _mean(total, counted), _mean_of(errors, counted), _mean_of(agreements, counted)
        )

    def _part(self, policy: Distribution, part: str) -> Any:
        if isinstance(policy, CompositeDistribution):
            return policy.dists[self._keys[part]]
        return policy

    def _of_vector(self, policy: Any, shown: Tensor) -> Tensor:
        target = shown.clamp(-LARGEST_ACTION, LARGEST_ACTION).atanh()
        if isinstance(policy, TanhNormalMixture):
            each = self._cross_entropy(policy, target.unsqueeze(-2))
            return -(policy.logits.log_softmax(-1) - each).logsumexp(-1)
        return self._cross_entropy(policy, target)

    def _cross_entropy(self, policy: Any, target: Tensor) -> Tensor:
        normal = Normal(policy.loc, policy.scale, validate_args=False)
        spread = 0.5 * (self._least / policy.scale) ** 2
        entropy: Tensor = spread - normal.log_prob(target)
        return entropy.sum(-1)


def _mean(values: Tensor, counted: Tensor) -> Tensor:
    """Return the mean over entries that count; 0 if there are none."""
    return torch.where(counted, values, torch.zeros_like(values)).sum() / counted.sum().clamp_min(1)


def _mean_of(parts: list[Tensor], counted: Tensor) -> Tensor:
    return _mean(torch.stack(parts).mean(0), counted) if parts else torch.tensor(math.nan)
