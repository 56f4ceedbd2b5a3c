"""The paper's network: an encoder per sense, joined; policy and value heads on the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum

import torch
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Tensor, nn

from veca_marl.algos.acting import ArrayModule
from veca_marl.algos.networks.encoders import (
    Arithmetic,
    Convolutions,
    Pooling,
    Precision,
    make_encoder,
)
from veca_marl.algos.networks.factory import NetworkCfg, NetworkFactory, register_network
from veca_marl.algos.networks.layers import (
    CRITIC_GAIN,
    CentralValue,
    PerAgent,
    StateValue,
    orthogonal,
    perceptron,
    value_layer,
)
from veca_marl.algos.networks.memory import GatedMemory, TeamMemory, features_and_state, state_alone
from veca_marl.algos.sense_encoders import SenseEncoders
from veca_marl.algos.specs import STATE, ArrayLayout, TeamSpec


class Critic(Enum):
    """The input of an agent's critic; its actor reads its own observation alone in all cases.

    Attributes:
        own: The agent's observation: independent PPO (de Witt et al. 2020).
        central: The observations of its whole team: MAPPO (Yu et al. 2022).
        state: Its observation and the global state: MAPPO with what Yu et al. call the
            "agent-specific" state. For PPO; needs ``global_state=true``.
    """

    own = "own"
    central = "central"
    state = "state"


class Parameters(Enum):
    """Whether the agents of a team share one network or have one each."""

    shared = "shared"
    separate = "separate"


class Memory(Enum):
    """Hidden state of each agent, which lasts for an episode.

    Attributes:
        none: None: an action depends on the present observation alone.
        gru: A gated recurrent unit between the joined layer and the heads.
        gru_shortcut: The same; the heads read the joined layer beside its state.
    """

    none = "none"
    gru = "gru"
    gru_shortcut = "gru_shortcut"


@dataclass
class MultisenseCfg(NetworkCfg):
    """Sizes of the network.

    Attributes:
        channels: Output channels of the three convolutions of an image encoder.
        kernels: Widths of their windows; ``[8, 4, 3]`` are those of Mnih et al. 2015.
        strides: Distances of their windows.
        pooling: Pooling of an image's last feature maps.
        vector_features: Width of the encoder of any sense that is not an image.
        compressed: Senses with values of many magnitudes: symlog is applied before their encoder.
            Otherwise accelerations would dominate the angles beside them. Names of senses that a
            team does not have are ignored.
        trunk_features: Width of the joined layer that both heads read, or the memory.
        memory: Hidden state between the joined layer and the heads.
        memory_features: Length of the hidden state of each agent.
        precision: Arithmetic of the encoder that learns; policies act in float32.
        critic: Input of the critic.
        parameters: One network for a team, or one for each of its agents.
        agent_identity: Whether the joined layer also reads which agent of its team it serves, as
            one of n; for networks that the agents share.
    """

    not_parameters = ("frozen", "precision")
    critics_only = ("critic",)

    name: str = "multisense"
    channels: list[int] = field(default_factory=lambda: [16, 32, 32])
    kernels: list[int] = field(default_factory=lambda: [4, 4, 3])
    strides: list[int] = field(default_factory=lambda: [4, 2, 1])
    pooling: Pooling = Pooling.flatten
    vector_features: int = 64
    compressed: list[str] = field(default_factory=lambda: ["proprioception"])
    trunk_features: int = 256
    memory: Memory = Memory.none
    memory_features: int = 256
    precision: Precision = Precision.auto
    critic: Critic = Critic.own
    parameters: Parameters = Parameters.shared
    agent_identity: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.agent_identity and self.parameters is Parameters.separate:
            raise ValueError(
                "network.agent_identity=true is for network.parameters=shared: with "
                "parameters=separate each agent has a network of its own"
            )
        for name in ("channels", "kernels", "strides"):
            numbers = list(getattr(self, name))
            if len(numbers) != 3 or min(numbers) < 1:
                raise ValueError(f"network.{name}: need 3 positive numbers, got {numbers}")
        if min(self.vector_features, self.trunk_features, self.memory_features) < 1:
            raise ValueError(f"network: sizes must be positive, got {self}")

    @property
    def convolutions(self) -> Convolutions:
        """Sizes of the convolutions of an image encoder."""
        return Convolutions(self.channels, self.kernels, self.strides)

    @property
    def recurrent(self) -> bool:
        """See `NetworkCfg`."""
        return self.memory is not Memory.none

    @property
    def head_inputs(self) -> int:
        """Number of features that the heads read."""
        if not self.recurrent:
            return self.trunk_features
        skipped = self.trunk_features if self.memory is Memory.gru_shortcut else 0
        return skipped + self.memory_features


class Trunk(nn.Module):
    """Observations ``(..., agents, *shape)`` of each sense to features ``(..., agents, F)``.

    Agents are folded into the batch: they share the parameters. A sense that the team does not
    have leaves no parameters.

    Args:
        observations: The observations of an agent.
        cfg: Sizes.
        identities: Number of agents that it tells from each other, or 0.
    """

    def __init__(
        self, observations: dict[str, ArrayLayout], cfg: MultisenseCfg, identities: int = 0
    ) -> None:
        super().__init__()
        self.identities = identities
        self.ranks = {name: len(layout.shape) for name, layout in observations.items()}
        encoders = {
            name: make_encoder(
                name,
                layout,
                cfg.convolutions,
                cfg.vector_features,
                cfg.pooling,
                name in cfg.compressed,
            )
            for name, layout in observations.items()
        }
        self.encoders = SenseEncoders(encoders)
        joined = sum(encoder.features for encoder in encoders.values()) + identities
        self.join = nn.Sequential(orthogonal(nn.Linear(joined, cfg.trunk_features)), nn.ReLU())
        self.arithmetic = Arithmetic(cfg.precision)

    def forward(self, *observations: Tensor) -> Tensor:
        """Encode and join one tensor per sense, in the order of the spec."""
        first_rank = next(iter(self.ranks.values()))
        leading = observations[0].shape[: observations[0].ndim - first_rank]
        with self.arithmetic.context(observations[0].device):
            parts = [
                encoder(array.reshape(-1, *array.shape[len(leading) :]))
                for encoder, array in zip(self.encoders.values(), observations, strict=True)
            ]
            if self.identities:
                each = torch.eye(self.identities, dtype=parts[0].dtype, device=parts[0].device)
                parts.append(each.repeat(leading[:-1].numel(), 1))
            features: Tensor = self.join(torch.cat(parts, dim=-1))
        return features.float().reshape(*leading, -1)


class Multisense(NetworkFactory):
    """Makes the parts of the default network."""

    cfg: MultisenseCfg

    def __init__(self, team: str, spec: TeamSpec, cfg: MultisenseCfg) -> None:
        super().__init__(team, spec, cfg)
        self.features = cfg.head_inputs

    def encoder(self) -> TensorDictModuleBase:
        """Return the encoder of all senses, joined, and the memory after it."""
        layouts = self.spec.observations
        ranks = [len(layout.shape) for layout in layouts.values()]
        identities = self.spec.agents if self.cfg.agent_identity else 0
        trunk = ArrayModule(
            self.per_agent(lambda: Trunk(layouts, self.cfg, identities), ranks),
            in_keys=[(self.team, "observation", name) for name in layouts],
            out_keys=[(self.team, "features")],
        )
        return TensorDictSequential(trunk, self._memory()) if self.cfg.recurrent else trunk

    def _memory(self) -> TeamMemory:
        spec, size = self.spec, self.cfg.memory_features
        output = features_and_state if self.cfg.memory is Memory.gru_shortcut else state_alone
        memory = self.per_agent(
            lambda: GatedMemory(self.cfg.trunk_features, size), (1,) * (4 if spec.masked else 3)
        )
        return TeamMemory(self.team, spec.agents, size, spec.masked, output, memory)

    @property
    def central_critic(self) -> bool:
        """See `NetworkFactory`."""
        return self.cfg.critic is Critic.central

    @property
    def critic_reads_state(self) -> bool:
        """See `NetworkFactory`."""
        return self.cfg.critic is Critic.state

    def critic(self) -> TensorDictModule:
        """Return the value head; a central one also reads which agents are present.

        Raises:
            ValueError: If the critic is to read the global state, and there is none.
        """
        features, kind = (self.team, "features"), self.cfg.critic
        head: nn.Module
        if kind is Critic.state:
            head, keys = self._state_critic(), [features, STATE]
        elif kind is Critic.central:
            head, keys = self._central_critic(), [features]
            keys += [(self.team, "mask")] if self.spec.masked else []
        else:
            head, keys = self.per_agent(lambda: value_layer(self.features)), [features]
        return TensorDictModule(head, in_keys=keys, out_keys=[(self.team, "state_value")])

    def _central_critic(self) -> CentralValue:
        width = self.features

        def joint() -> nn.Module:
            hidden = orthogonal(nn.Linear(2 * width, width)), nn.ReLU()
            return nn.Sequential(*hidden, value_layer(width))

        return CentralValue(self.per_agent(joint))

    def _state_critic(self) -> StateValue:
        width, state = self.features, self.spec.state
        if not state:
            raise ValueError(
                "algo.network.critic=state reads the global state, which this environment does not "
                "have: set global_state=true"
            )
        head = self.per_agent(lambda: perceptron(width + state, [width], 1, CRITIC_GAIN))
        return StateValue(head)

    def per_agent(self, make: Callable[[], nn.Module], ranks: Sequence[int] = (1,)) -> nn.Module:
        """See `NetworkFactory`."""
        if self.cfg.parameters is Parameters.shared:
            return make()
        return PerAgent(make, self.spec.agents, ranks)


register_network("multisense", MultisenseCfg, Multisense)
