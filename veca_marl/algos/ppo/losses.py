"""Clipped PPO with an exact divergence, in which only the agents that are present count."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import CompositeDistribution
from torch import Tensor
from torch.distributions import Distribution, kl_divergence
from torchrl.objectives.multiagent import MAPPOLoss

from veca_marl.algos.specs import PLAIN, action_key

# where TorchRL's losses look for the entries that count, to normalise advantages and to average
VALID = "shifted_valid"


class TeamPPOLoss(MAPPOLoss):
    """TorchRL's clipped PPO for several agents, with three differences.

    - ``kl_approx`` is the analytic KL(old || new). TorchRL reports the mean of
      ``log old - log new`` over the sampled actions; its sign fluctuates, and a negative value
      never moves an adaptive learning rate. The batch holds the parameters of the distribution
      that acted, so this costs no forward pass (for two tanh-normals it is that of the normals).
    - Entries with `VALID` False are excluded from every reported measure; TorchRL excludes them
      from the losses and from the normalisation of advantages alone.
    - The statistics by which targets and values are normalised are constant while a batch is
      learnt: the critic's outputs are scaled by them. TorchRL updates them inside the loss.

    Overrides the private hooks ``_log_weight``, ``_get_entropy`` and ``_critic_loss_inputs``, see
    `private_parts`; `tests/algos/ppo/test_losses.py` compares each with its formula.

    Attributes:
        value_norm: Running statistics of the value targets, or None; see `NormalisedCritic`.
    """

    _valid: Tensor | None = None  # of the batch in `forward`, (..., agents, 1)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Return losses and measures of a minibatch: steps ``(n,)`` or sequences ``(n, time)``."""
        self._valid = tensordict.get(VALID, None)
        out: TensorDictBase = super().forward(tensordict)
        if self._valid is not None:
            # both are means over all entries, with zeros where an entry does not count
            share = self._valid.float().mean().clamp_min(1.0 / self._valid.numel())
            for name in ("clip_fraction", "entropy"):
                out[name] = out[name] / share
        self._valid = None
        return out

    def _log_weight(
        self, tensordict: TensorDictBase, adv_shape: torch.Size
    ) -> tuple[Tensor, Distribution, Tensor, Any]:
        with torch.no_grad():  # before the forward pass overwrites the parameters in tensordict
            old = self.actor_network.build_dist_from_params(tensordict)
        log_weight, new, _, correction = super()._log_weight(tensordict, adv_shape)
        with torch.no_grad():
            divergence = _divergence(old, new)
        if self._valid is not None:
            divergence = divergence[self._valid.squeeze(-1)]
            log_weight = _zero_unless(self._valid, log_weight)
        return log_weight, new, divergence, correction

    def _get_entropy(self, dist: Distribution, adv_shape: torch.Size) -> Tensor | TensorDict:
        entropy = super()._get_entropy(dist, adv_shape)
        if self._valid is None:
            return entropy
        if isinstance(entropy, Tensor):
            return _zero_unless(self._valid, entropy)
        return entropy.apply(lambda part: _zero_unless(self._valid, part))

    def _critic_loss_inputs(
        self, target_return: Tensor, state_value: Tensor, old_state_value: Tensor | None
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        if self.value_norm is None:
            return target_return, state_value, old_state_value
        normalise = self.value_norm.normalize
        return normalise(target_return), normalise(state_value), old_state_value

    def loss_critic(self, tensordict: TensorDictBase) -> tuple[Any, ...]:
        """Return what `ClipPPOLoss.loss_critic` returns, its explained variance masked.

        TorchRL takes the variance over the first dimension alone; of sequences it is the variance
        over all steps.
        """
        loss, clip_fraction, explained = super().loss_critic(tensordict)
        if self._valid is not None or tensordict.ndim > 1:
            target = tensordict[self.tensor_keys.value_target]
            value = tensordict[self.tensor_keys.value].detach()
            valid = (
                torch.ones_like(target, dtype=torch.bool) if self._valid is None else self._valid
            )
            rows = (array.flatten(0, -3) for array in (target, value, valid))
            explained = explained_variance(*rows)
        return loss, clip_fraction, explained


def explained_variance(target: Tensor, value: Tensor, valid: Tensor) -> Tensor:
    """Return 1 - Var(target - value) / Var(target) of each agent over the rows that count.

    Not a number for an agent without such a row.

    Args:
        target: ``(rows, agents, 1)``.
        value: The same shape.
        valid: The same shape, True for entries that count.
    """

    def variance(x: Tensor) -> Tensor:
        count = valid.sum(0).clamp_min(1)
        centred = _zero_unless(valid, x - _zero_unless(valid, x).sum(0) / count)
        return centred.square().sum(0) / count

    smallest = torch.finfo(target.dtype).eps
    explained = 1.0 - variance(target - value) / (variance(target) + smallest)
    return torch.where(valid.any(0), explained, torch.nan)


def _zero_unless(valid: Tensor | None, x: Tensor) -> Tensor:
    """Return `x` with zeros where `valid` is False; gradients there are zero too."""
    return x if valid is None else torch.where(valid, x, torch.zeros_like(x))


def _divergence(old: Distribution, new: Distribution) -> Tensor:
    """Return KL(old || new); the parts of an action are independent, so theirs are summed."""
    if isinstance(old, CompositeDistribution) and isinstance(new, CompositeDistribution):
        parts = [kl_divergence(old.dists[key], new.dists[key]) for key in old.dists]
        return torch.stack(parts).sum(0)
    return kl_divergence(old, new)


def check_entropy_coefficient(coefficient: object) -> None:
    """Check that it is a finite number, or a mapping from names of parts to finite numbers.

    Raises:
        ValueError: If it is not.
    """
    values = list(coefficient.values()) if isinstance(coefficient, Mapping) else [coefficient]
    if not values or not all(_is_number(value) for value in values):
        raise ValueError(
            "algo.entropy_coefficient must be a number, or a mapping from each part of the action "
            f"to a number, got {coefficient!r}"
        )


def entropy_weights(
    team: str, parts: Sequence[str], coefficient: float | Mapping[str, float]
) -> float | dict[Any, float]:
    """Return the coefficient as TorchRL's PPO losses take it.

    Args:
        team: Name of the team.
        parts: Names of the parts of its action.
        coefficient: A number, or a number for each part.

    Returns:
        A number; for an action of several parts and a mapping, a mapping from the keys under which
        `CompositeDistribution` writes the entropies of the parts.

    Raises:
        ValueError: If the mapping has other names than the parts.
    """
    if not isinstance(coefficient, Mapping):
        return float(coefficient)
    if set(coefficient) != set(parts):
        raise ValueError(
            f"algo.entropy_coefficient of team {team!r}: got a weight for {sorted(coefficient)}, "
            f"the parts of its action are {sorted(parts)}"
        )
    if set(parts) == {PLAIN}:
        return float(coefficient[PLAIN])
    keys = {part: action_key(team, part) for part in parts}
    return {
        (*key[:-1], f"{key[-1]}_entropy"): float(coefficient[part]) for part, key in keys.items()
    }


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)
