"""The paper's network: an encoder per sense, joined; policy and value heads on one trunk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from enum import Enum

import torch
from tensordict.nn import ProbabilisticTensorDictSequential, TensorDictModule
from torch import Tensor, nn

from veca_marl.algos.networks.encoders import Pooling, make_encoder, orthogonal
from veca_marl.algos.networks.policy_heads import action_distribution, policy_head
from veca_marl.algos.specs import ArrayLayout, TeamSpec


class Precision(Enum):
    """Arithmetic of the trunk; parameters, heads and losses are always float32."""

    float32 = "float32"
    bfloat16 = "bfloat16"


class Critic(Enum):
    """What the critic of an agent judges by; its actor sees its own observation alone in any case.

    Attributes:
        own: The agent's observation: independent PPO (de Witt et al. 2020).
        central: The observations of its whole team: MAPPO (Yu et al. 2022).
    """

    own = "own"
    central = "central"


class Parameters(Enum):
    """Whether the agents of a team share one network or have one each."""

    shared = "shared"
    separate = "separate"


@dataclass
class NetworkCfg:
    """Sizes of the network.

    Attributes:
        channels: Output channels of the three convolutions of an image encoder.
        pooling: What becomes of an image's last feature maps.
        vector_features: Width of the encoder of any sense that is not an image.
        compressed: Senses whose numbers are of many magnitudes: symlog comes before their encoder.
            Where angles stand beside accelerations, a network would hear little but the
            accelerations. Names of senses that a team does not have are no matter.
        trunk_features: Width of the joined layer that both heads read.
        precision: Arithmetic of encoders and trunk.
        critic: What the critic judges by.
        parameters: One network for a team, or one for each of its agents.
    """

    channels: list[int] = field(default_factory=lambda: [16, 32, 32])
    pooling: Pooling = Pooling.flatten
    vector_features: int = 64
    compressed: list[str] = field(default_factory=lambda: ["proprioception"])
    trunk_features: int = 256
    precision: Precision = Precision.float32
    critic: Critic = Critic.own
    parameters: Parameters = Parameters.shared

    def __post_init__(self) -> None:
        if len(self.channels) != 3:
            raise ValueError(f"network.channels: need 3 numbers, got {list(self.channels)}")
        if min(*self.channels, self.vector_features, self.trunk_features) < 1:
            raise ValueError(f"network: sizes must be positive, got {self}")


class Trunk(nn.Module):
    """Observations ``(..., agents, *shape)`` of each sense to features ``(..., agents, F)``.

    Agents are folded into the batch: they share the parameters. A sense that the team does not
    have leaves no parameters.
    """

    def __init__(self, observations: dict[str, ArrayLayout], cfg: NetworkCfg) -> None:
        super().__init__()
        self.ranks = {name: len(layout.shape) for name, layout in observations.items()}
        encoders = {
            name: make_encoder(
                name,
                layout,
                cfg.channels,
                cfg.vector_features,
                cfg.pooling,
                name in cfg.compressed,
            )
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


class PerAgent(nn.Module):
    """A module for each agent: arrays ``(..., agents, *shape)`` to ``(..., agents, F)``.

    Args:
        make: Makes one; its input keeps an agent dimension, of length one.
        agents: How many.
        ranks: The number of dimensions of each array's `shape`.
    """

    def __init__(self, make: Callable[[], nn.Module], agents: int, ranks: Sequence[int]) -> None:
        super().__init__()
        self.agents = nn.ModuleList(make() for _ in range(agents))
        self._dims = [-rank - 1 for rank in ranks]

    def forward(self, *arrays: Tensor) -> Tensor:
        """Let each agent's module work on its part."""
        parts = [
            module(*(a.narrow(d, i, 1) for a, d in zip(arrays, self._dims, strict=True)))
            for i, module in enumerate(self.agents)
        ]
        return torch.cat(parts, dim=-2)


class WithTeam(nn.Module):
    """Features ``(..., agents, F)`` to ``(..., agents, 2 F)``: each beside the mean of its team."""

    def forward(self, features: Tensor) -> Tensor:
        """Append the mean over the agents."""
        mean = features.mean(dim=-2, keepdim=True).expand_as(features)
        return torch.cat([features, mean], dim=-1)


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
        ranks = [len(layout.shape) for layout in spec.observations.values()]
        self.trunk = TensorDictModule(
            _of_the_agents(lambda: Trunk(spec.observations, cfg), spec, cfg, ranks),
            in_keys=[(team, "observation", name) for name in spec.observations],
            out_keys=[(team, "features")],
        )
        heads = [
            policy_head(
                team,
                part,
                layout,
                _of_the_agents(_linear(cfg.trunk_features, layout.parameters), spec, cfg),
            )
            for part, layout in spec.actions.items()
        ]
        self.actor = ProbabilisticTensorDictSequential(
            self.trunk, *heads, action_distribution(team, spec.actions)
        )
        self.distribution_keys = [key for head in heads for key in head.out_keys]
        self.critic = TensorDictModule(
            _value_head(spec, cfg),
            in_keys=[(team, "features")],
            out_keys=[(team, "state_value")],
        )


def _of_the_agents(
    make: Callable[[], nn.Module], spec: TeamSpec, cfg: NetworkCfg, ranks: Sequence[int] = (1,)
) -> nn.Module:
    """Return a module for the whole team, or one for each of its agents."""
    if cfg.parameters is Parameters.shared:
        return make()
    return PerAgent(make, spec.agents, ranks)


def _linear(features: int, outputs: int) -> Callable[[], nn.Module]:
    # a small gain: the first policy is nearly the same everywhere (Huang et al. 2022, detail 2)
    return lambda: orthogonal(nn.Linear(features, outputs), gain=0.01)


def _value_head(spec: TeamSpec, cfg: NetworkCfg) -> nn.Module:
    """Return what turns features ``(..., agents, F)`` into values ``(..., agents, 1)``."""
    width = cfg.trunk_features
    if cfg.critic is Critic.own:
        return _of_the_agents(lambda: orthogonal(nn.Linear(width, 1), gain=1.0), spec, cfg)

    def judge() -> nn.Module:
        return nn.Sequential(
            orthogonal(nn.Linear(2 * width, width)),
            nn.ReLU(),
            orthogonal(nn.Linear(width, 1), gain=1.0),
        )

    return nn.Sequential(WithTeam(), _of_the_agents(judge, spec, cfg))
