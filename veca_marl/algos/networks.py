"""The paper's network: an encoder per sense, joined; policy and value heads on one trunk."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from enum import Enum

import torch
from tensordict.nn import (
    NormalParamExtractor,
    ProbabilisticTensorDictModule,
    ProbabilisticTensorDictSequential,
    TensorDictModule,
)
from torch import Tensor, nn
from torch.distributions import Categorical
from torchrl.modules import TanhNormal

from veca_marl.algos.encoders import make_encoder, orthogonal
from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec


class Precision(Enum):
    """Arithmetic of the trunk; parameters, heads and losses are always float32."""

    float32 = "float32"
    bfloat16 = "bfloat16"


@dataclass
class NetworkCfg:
    """Sizes of the network.

    Attributes:
        channels: Output channels of the three convolutions of an image encoder.
        vector_features: Width of the encoder of any sense that is not an image.
        trunk_features: Width of the joined layer that both heads read.
        precision: Arithmetic of encoders and trunk.
    """

    channels: list[int] = field(default_factory=lambda: [16, 32, 32])
    vector_features: int = 64
    trunk_features: int = 256
    precision: Precision = Precision.float32

    def __post_init__(self) -> None:
        if len(self.channels) != 3:
            raise ValueError(f"network.channels: need 3 numbers, got {list(self.channels)}")
        if min(*self.channels, self.vector_features, self.trunk_features) < 1:
            raise ValueError(f"network: sizes must be positive, got {self}")


class Trunk(nn.Module):
    """Observations ``(..., agents, *shape)`` of each sense to features ``(..., agents, F)``.

    Agents of a team are folded into the batch: they share the parameters. A sense that the team
    does not have leaves no parameters.
    """

    def __init__(self, observations: dict[str, ArrayLayout], cfg: NetworkCfg) -> None:
        super().__init__()
        self.ranks = {name: len(layout.shape) for name, layout in observations.items()}
        encoders = {
            name: make_encoder(name, layout, cfg.channels, cfg.vector_features)
            for name, layout in observations.items()
        }
        self.encoders = nn.ModuleDict(encoders)
        joined = sum(encoder.features for encoder in encoders.values())
        self.join = nn.Sequential(orthogonal(nn.Linear(joined, cfg.trunk_features)), nn.ReLU())
        self.precision = cfg.precision

    def forward(self, *observations: Tensor) -> Tensor:
        """Encode and join one tensor per sense, in the order of the spec."""
        first_rank = next(iter(self.ranks.values()))
        leading = observations[0].shape[: observations[0].ndim - first_rank]
        with self._arithmetic(observations[0].device):
            parts = [
                encoder(array.reshape(-1, *array.shape[len(leading) :]))
                for encoder, array in zip(self.encoders.values(), observations, strict=True)
            ]
            features = self.join(torch.cat(parts, dim=-1))
        return features.float().reshape(*leading, -1)

    def _arithmetic(self, device: torch.device) -> AbstractContextManager[object]:
        if self.precision is Precision.float32:
            return nullcontext()
        return torch.autocast(device.type, dtype=torch.bfloat16)


class TeamNetwork(nn.Module):
    """Actor and critic of one team over a shared trunk.

    Attributes:
        trunk: Writes ``(team, "features")``.
        actor: Trunk, policy head and distribution; writes the action and its log-probability.
        critic: The value head alone: it reads the features that the actor has already computed,
            which halves an update and leaves loss and gradient as they would be otherwise.
        distribution_keys: Where the parameters of the policy's distribution are written.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: NetworkCfg) -> None:
        super().__init__()
        self.trunk = TensorDictModule(
            Trunk(spec.observations, cfg),
            in_keys=[(team, "observation", name) for name in spec.observations],
            out_keys=[(team, "features")],
        )
        head, distribution = _policy_head(team, spec.action, cfg.trunk_features)
        self.actor = ProbabilisticTensorDictSequential(self.trunk, head, distribution)
        self.distribution_keys = list(head.out_keys)
        self.critic = TensorDictModule(
            orthogonal(nn.Linear(cfg.trunk_features, 1), gain=1.0),
            in_keys=[(team, "features")],
            out_keys=[(team, "state_value")],
        )


def _policy_head(
    team: str, action: ActionLayout, features: int
) -> tuple[TensorDictModule, ProbabilisticTensorDictModule]:
    """Return the layer that parametrises the distribution, and the distribution."""
    outputs = action.size if action.discrete else 2 * action.size
    # a small gain: the first policy is nearly the same everywhere (Huang et al. 2022, detail 2)
    layer: nn.Module = orthogonal(nn.Linear(features, outputs), gain=0.01)
    if not action.discrete:
        layer = nn.Sequential(layer, NormalParamExtractor())
    names = ["logits"] if action.discrete else ["loc", "scale"]
    keys = [(team, name) for name in names]
    distribution = ProbabilisticTensorDictModule(
        in_keys=dict(zip(names, keys, strict=True)),
        out_keys=[(team, "action")],
        distribution_class=Categorical if action.discrete else TanhNormal,
        distribution_kwargs={} if action.discrete else {"low": -1.0, "high": 1.0},
        return_log_prob=True,
        log_prob_key=(team, "action_log_prob"),
    )
    return TensorDictModule(layer, in_keys=[(team, "features")], out_keys=keys), distribution
