"""An action of several parts as the critics read it: a vector, and one of all combinations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import CompositeDistribution
from torch import Tensor
from torch.distributions import Categorical, Distribution
from torch.nn.functional import one_hot
from torchrl.modules.distributions.utils import rsample_and_log_prob

from veca_marl.algos.specs import PLAIN, ActionLayout, action_key


@dataclass(frozen=True)
class Taken:
    """Actions that were taken.

    Attributes:
        vector: Continuous parts, joined: ``(..., agents, A)``; A is 0 if there are none.
        combination: Number of the combination of choices, ``(..., agents)`` int64.
        code: `vector` and the choices as one-hot vectors, joined: ``(..., agents, C)``.
    """

    vector: Tensor
    combination: Tensor
    code: Tensor


@dataclass(frozen=True)
class Proposed:
    """Actions of the current policy: continuous parts sampled, discrete parts as probabilities.

    Attributes:
        vector: Continuous parts, reparametrised, joined: ``(..., agents, A)``.
        probabilities: Probability of each combination of choices, ``(..., agents, K)``; K is 1
            without discrete parts.
        entropies: Part of the action to its entropy ``(..., agents)`` in nats: exact for a
            discrete part, the estimate ``-log_prob`` of the sample for a continuous one.
    """

    vector: Tensor
    probabilities: Tensor
    entropies: dict[str, Tensor]


LEAST_PROBABILITY_RATIO = 1e-3
"""Probability of a choice, relative to the most likely one, below which losses do not lower it."""


class _Bounded(torch.autograd.Function):
    """Logits with a lower bound; gradients that raise a logit below the bound pass unchanged.

    A softmax that is saturated has no gradient: with logits 20 apart that of the lower one is
    2e-9 of the difference of the values, less than the epsilon of Adam, and a policy that
    saturated on early, wrong values would keep its choice whatever the critics learn later.
    """

    @staticmethod
    def forward(ctx: Any, logits: Tensor) -> Tensor:
        highest = logits.amax(-1, keepdim=True)
        bounded = logits.maximum(highest + math.log(LEAST_PROBABILITY_RATIO))
        ctx.save_for_backward(bounded > logits, logits.argmax(-1, keepdim=True))
        return bounded

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        """Drop what would lower a logit below the bound further, or raise the highest for it."""
        below, highest = ctx.saved_tensors
        kept = gradients[0].masked_fill(below & (gradients[0] > 0.0), 0.0)
        return kept.scatter_add(-1, highest, -kept.sum(-1, keepdim=True))


class JointAction:
    """Joins and splits the parts of a team's action.

    Combinations are numbered with the last part varying fastest.

    Args:
        team: Name of the team.
        actions: Part to its layout.
    """

    def __init__(self, team: str, actions: Mapping[str, ActionLayout]) -> None:
        self._keys = {part: action_key(team, part) for part in actions}
        self._vectors = [part for part, layout in actions.items() if not layout.discrete]
        self._choices = {part: a.size for part, a in actions.items() if a.discrete}

    def taken(self, rows: TensorDictBase) -> Taken:
        """Return the actions that are stored in `rows`."""
        vectors = [rows[self._keys[part]] for part in self._vectors]
        choices = {part: rows[self._keys[part]] for part in self._choices}
        lead = vectors[0].shape[:-1] if vectors else next(iter(choices.values())).shape
        vector = torch.cat(vectors, -1) if vectors else torch.zeros(*lead, 0, device=rows.device)
        combination = torch.zeros(lead, dtype=torch.int64, device=vector.device)
        for part, size in self._choices.items():
            combination = combination * size + choices[part]
        return Taken(vector, combination, self._encode(vector, combination))

    def propose(self, policy: Distribution) -> Proposed:
        """Return actions of the distribution that the policy heads gave.

        Choices have at least `LEAST_PROBABILITY_RATIO` of the probability of the most likely one.
        """
        dists = self._split(policy)
        bounded: Any = _Bounded.apply  # without types in torch 2.13, with them in 2.14
        for part in self._choices:
            dists[part] = Categorical(logits=bounded(dists[part].logits))
        vectors, entropies = [], {}
        for part in self._vectors:
            sample, log_prob = rsample_and_log_prob(dists[part])
            vectors.append(sample)
            entropies[part] = -log_prob
        for part in self._choices:
            entropies[part] = dists[part].entropy()
        joint = torch.ones_like(next(iter(entropies.values()))).unsqueeze(-1)
        for part in self._choices:
            probabilities = dists[part].logits.softmax(-1)
            joint = (joint.unsqueeze(-1) * probabilities.unsqueeze(-2)).flatten(-2)
        vector = torch.cat(vectors, -1) if vectors else joint[..., :0]
        return Proposed(vector, joint, entropies)

    def sample_code(self, proposed: Proposed) -> Tensor:
        """Return actions drawn from `proposed`, encoded as `Taken.code`, without gradient."""
        drawn = Categorical(probs=proposed.probabilities.detach()).sample()
        return self._encode(proposed.vector.detach(), drawn)

    def _split(self, policy: Distribution) -> dict[str, Any]:
        """Return the distribution of each part."""
        if isinstance(policy, CompositeDistribution):
            return {part: policy.dists[key] for part, key in self._keys.items()}
        return {PLAIN: policy}

    def _encode(self, vector: Tensor, combination: Tensor) -> Tensor:
        """Join `vector` and the choices that `combination` stands for, as one-hot vectors."""
        codes: list[Tensor] = []
        for size in reversed(self._choices.values()):
            codes.insert(0, one_hot(combination % size, size).to(vector.dtype))
            combination = combination // size
        return torch.cat([vector, *codes], -1)
