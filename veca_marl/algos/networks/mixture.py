"""Mixtures of normal distributions, for policies that imitate experts with several modes.

If an expert passes an obstacle on the left in some episodes and on the right in others, the mean of
one normal distribution leads into the obstacle.
"""

from __future__ import annotations

import math

import torch
from tensordict.nn import NormalParamExtractor
from torch import Size, Tensor, nn
from torch.distributions import Categorical, Distribution
from torch.nn.functional import softplus
from torch.quasirandom import SobolEngine

_LOG_2, _LOG_ROOT_2_PI = math.log(2.0), math.log(math.sqrt(2.0 * math.pi))


class TanhNormalMixture(Distribution):
    """A mixture of normal distributions of a vector, mapped to (-1, 1) by tanh.

    Bishop 1994, "Mixture density networks". It has no reparametrised samples, and its entropy and
    divergences have no closed form.

    Args:
        loc: Means before tanh, ``(..., modes, A)``.
        scale: Standard deviations before tanh, the same shape.
        logits: Logarithms of the weights, up to a constant, ``(..., modes)``.
    """

    has_rsample = False

    def __init__(self, loc: Tensor, scale: Tensor, logits: Tensor) -> None:
        super().__init__(loc.shape[:-2], loc.shape[-1:], validate_args=False)
        self.loc, self.scale, self.logits = loc, scale, logits

    @property
    def deterministic_sample(self) -> Tensor:
        """The mean before tanh of the distribution with the greatest weight, as an action."""
        return _bounded(_chosen(self.loc, self.logits.argmax(-1)))

    @torch.no_grad()
    def sample(self, sample_shape: Size | list[int] | tuple[int, ...] = ()) -> Tensor:
        """Return actions ``(*sample_shape, ..., A)``."""
        shape = Size(sample_shape)
        chosen = Categorical(logits=self.logits, validate_args=False).sample(shape)
        loc, scale = (
            _chosen(each.expand(*shape, *each.shape), chosen) for each in (self.loc, self.scale)
        )
        noise = torch.normal(torch.zeros_like(loc), torch.ones_like(loc))
        return _bounded(loc + noise * scale)

    def log_prob(self, value: Tensor) -> Tensor:
        """Return the logarithm of the density of actions ``(..., A)``."""
        normal = value.atanh().unsqueeze(-2)
        density = -((normal - self.loc) ** 2) / (2.0 * self.scale**2)
        density = (density - self.scale.log() - _LOG_ROOT_2_PI).sum(-1)
        jacobian = 2.0 * (_LOG_2 - normal - softplus(-2.0 * normal)).sum(-1)
        mixed: Tensor = (self.logits.log_softmax(-1) + density - jacobian).logsumexp(-1)
        return mixed


def draw_mixture(
    sampled: bool, loc: Tensor, scale: Tensor, logits: Tensor
) -> tuple[Tensor, Tensor]:
    """Return action ``(..., A)`` in (-1, 1) and log-probability ``(...)``.

    Args:
        sampled: Whether to sample; otherwise the action is the mean of the likeliest distribution.
        loc: As for `TanhNormalMixture`.
        scale: Likewise.
        logits: Likewise.
    """
    distribution = TanhNormalMixture(loc, scale, logits)
    action = distribution.sample() if sampled else distribution.deterministic_sample
    return action, distribution.log_prob(action)


class MixtureParameters(nn.Module):
    """The parameters of a `TanhNormalMixture` from the output of a layer.

    A different constant is added to each mean before tanh; they are spread evenly over [-1, 1].
    Distributions with equal means would receive nearly equal gradients, and stay equal.

    Args:
        layer: Maps features to ``modes * (2 size + 1)`` numbers.
        modes: Number of normal distributions.
        size: Length of the action.
        scale_mapping: As for TensorDict's `NormalParamExtractor`.
    """

    means: Tensor

    def __init__(self, layer: nn.Module, modes: int, size: int, scale_mapping: str) -> None:
        super().__init__()
        self.layer, self._modes = layer, modes
        self._extract = NormalParamExtractor(scale_mapping=scale_mapping)
        points = SobolEngine(size).draw(modes + 1)[1:]  # the first point is a corner
        self.register_buffer("means", 2.0 * points - 1.0, persistent=False)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return loc and scale ``(..., modes, size)`` and logits ``(..., modes)``."""
        found: Tensor = self.layer(features)
        logits, normals = found[..., : self._modes], found[..., self._modes :]
        loc, scale = self._extract(normals.unflatten(-1, (self._modes, -1)))
        return loc + self.means, scale, logits


def _chosen(values: Tensor, chosen: Tensor) -> Tensor:
    """Return of values ``(..., modes, A)`` the chosen modes', ``(..., A)``."""
    index = chosen[..., None, None].expand(*chosen.shape, 1, values.shape[-1])
    return values.gather(-2, index).squeeze(-2)


def _bounded(loc: Tensor) -> Tensor:
    limit = 1.0 - torch.finfo(loc.dtype).resolution
    return loc.tanh().clamp(-limit, limit)
