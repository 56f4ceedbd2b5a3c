"""ClipPPOLoss that reports the exact divergence between the old and the new policy."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import CompositeDistribution
from torch import Tensor
from torch.distributions import Distribution, kl_divergence
from torchrl.objectives import ClipPPOLoss

# where TorchRL's losses look for the rows that count, both to normalise and to average
VALID = "shifted_valid"


class ExactKLPPOLoss(ClipPPOLoss):
    """Clipped PPO whose ``kl_approx`` is the analytic KL(old || new).

    TorchRL reports the mean of ``log old - log new`` over the sampled actions; its sign
    fluctuates, and a negative value never moves an adaptive learning rate. The batch holds the
    parameters of the distribution that acted, so the divergence itself costs no forward pass
    (for two tanh-normals it is that of the normals: the tanh drops out). Rows that do not count
    (`VALID` is False there) do not enter it.

    Overrides the private hook ``_log_weight``; `tests/algos/test_losses.py` pins it.
    """

    def _log_weight(
        self, tensordict: TensorDictBase, adv_shape: torch.Size
    ) -> tuple[Tensor, Distribution, Tensor, Any]:
        with torch.no_grad():  # before the forward pass overwrites the parameters in tensordict
            old = self.actor_network.build_dist_from_params(tensordict)
        log_weight, new, _, correction = super()._log_weight(tensordict, adv_shape)
        with torch.no_grad():
            divergence = _divergence(old, new)
            valid = tensordict.get(VALID, None)
            if valid is not None:
                divergence = divergence[valid.squeeze(-1)]
        return log_weight, new, divergence, correction


def _divergence(old: Distribution, new: Distribution) -> Tensor:
    """Return KL(old || new); the parts of an action are independent, so theirs are summed."""
    if isinstance(old, CompositeDistribution):
        return sum(kl_divergence(old.dists[key], new.dists[key]) for key in old.dists)
    return kl_divergence(old, new)
