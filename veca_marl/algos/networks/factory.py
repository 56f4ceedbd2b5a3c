"""What makes the network of a team: exchangeable, chosen by name in the configuration.

To train a network of your own, derive from `NetworkFactory` (often `encoder` and `features` are
all there is to write), derive its numbers from `NetworkCfg`, and call `register_network`. It is
then chosen by ``algo/network=NAME`` on the command line.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from tensordict.nn import ProbabilisticTensorDictSequential, TensorDictModule, TensorDictModuleBase
from torch import nn

from veca_marl.algos.algorithm import Algorithm, ChoiceRegistry
from veca_marl.algos.networks.layers import perceptron, value_layer
from veca_marl.algos.networks.policy_heads import (
    SMALLEST_SCALE,
    action_distribution,
    parameter_count,
    policy_head,
)
from veca_marl.algos.sense_encoders import copy_parameters, encoders_of
from veca_marl.algos.specs import TeamSpec


@dataclass
class NetworkCfg:
    """Base class of the numbers of a network.

    Attributes:
        name: Name of the network in the registry.
        frozen: Senses with encoders that keep their parameters, see `init_encoders`.
        initial_scale: Standard deviation of continuous actions before the first update, before
            tanh maps them to [-1, 1]: with 1 they are nearly uniform, with 0.3 nearly normal.
            Greater than 0.01.
        modes: Number of normal distributions in the mixture for each vector of an action, from 1 to
            100; more than 1 for algorithms that imitate. A mixture can represent labels that
            depend on something that the observation does not show. The deterministic
            action is the mean of the distribution with the greatest weight.
        not_parameters: Fields that a network with the same parameters may have differently.
        critics_only: Fields that do not concern the actor.
    """

    not_parameters: ClassVar[tuple[str, ...]] = ("frozen",)
    critics_only: ClassVar[tuple[str, ...]] = ()

    name: str = ""
    frozen: list[str] = field(default_factory=list)
    initial_scale: float = 1.0
    modes: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.modes <= 100:
            raise ValueError(f"network.modes must be from 1 to 100, got {self.modes}")
        if not SMALLEST_SCALE < self.initial_scale < math.inf:
            raise ValueError(
                f"network.initial_scale must be finite and above {SMALLEST_SCALE}, "
                f"got {self.initial_scale}"
            )

    @property
    def recurrent(self) -> bool:
        """Whether the network has hidden state and learns from sequences of steps."""
        return False


def check_one_mode(cfg: NetworkCfg, algorithm: str) -> None:
    """Check that the policies are no mixtures, of which entropy and divergence have no formula.

    Raises:
        ValueError: If they are.
    """
    if cfg.modes > 1:
        raise ValueError(
            f"algo.network.modes={cfg.modes} is for algo=bc and algo=dagger; {algorithm} needs 1"
        )


class NetworkFactory(ABC):
    """Makes encoder, actor and critic of one team.

    Args:
        team: Name of the team, the first part of all keys.
        spec: Its arrays.
        cfg: The numbers.

    Attributes:
        features: Length of the vector that the encoder writes for each agent.
    """

    features: int

    def __init__(self, team: str, spec: TeamSpec, cfg: Any) -> None:
        self.team, self.spec, self.cfg = team, spec, cfg

    @abstractmethod
    def encoder(self) -> TensorDictModuleBase:
        """Return the module from observations to ``(team, "features")``, ``(..., agents, F)``.

        A recurrent one reads its hidden state under ``(team, "memory", name)`` and ``"is_init"``
        where an episode begins, writes the new state under ``("next", team, "memory", name)`` and
        has a method ``make_tensordict_primer``, which returns `networks.memory.memory_primer`.
        In TorchRL's recurrent mode (`torchrl.modules.set_recurrent_mode`) its input is
        ``(rows, time)``: it unrolls each row from the state that is stored at its first step, and
        from the stored one where an episode begins.
        """

    def per_agent(self, make: Callable[[], nn.Module], ranks: Sequence[int] = (1,)) -> nn.Module:
        """Return one module for all agents of the team, or one that holds a module for each.

        Args:
            make: Makes one module, which maps ``(..., agents, *shape)`` to ``(..., agents, F)``.
            ranks: Number of dimensions of each input's `shape`.
        """
        return make()

    @property
    def central_critic(self) -> bool:
        """Whether an agent's critic reads what its whole team observes."""
        return False

    @property
    def critic_reads_state(self) -> bool:
        """Whether it reads the global state."""
        return False

    def actor(
        self, encoder: TensorDictModuleBase, hidden: Sequence[int] = ()
    ) -> ProbabilisticTensorDictSequential:
        """Return `encoder`, a head for each part of the action, and the distribution.

        Args:
            encoder: Writes the features.
            hidden: Widths of hidden layers in each head.
        """
        scale, modes = self.cfg.initial_scale, self.cfg.modes
        heads = [
            policy_head(
                self.team,
                part,
                layout,
                self.policy_layer(parameter_count(layout, modes), hidden),
                scale,
                modes,
            )
            for part, layout in self.spec.actions.items()
        ]
        return ProbabilisticTensorDictSequential(
            encoder, *heads, action_distribution(self.team, self.spec.actions, modes)
        )

    def policy_layer(self, outputs: int, hidden: Sequence[int] = ()) -> nn.Module:
        """Return the layers from features to the parameters of a distribution.

        The gain of the last one is small, so that the first policy hardly depends on the
        observation.
        Source: Huang et al. 2022, "The 37 implementation details of PPO", detail 2.
        """
        return self.per_agent(lambda: perceptron(self.features, hidden, outputs, gain=0.01))

    def critic(self) -> TensorDictModuleBase:
        """Return the module from ``(team, "features")`` to ``(team, "state_value")``."""
        return TensorDictModule(
            value_layer(self.features),
            in_keys=[(self.team, "features")],
            out_keys=[(self.team, "state_value")],
        )


class TeamNetwork(nn.Module):
    """Actor and critic of one team over a shared encoder.

    Attributes:
        encoder: Writes ``(team, "features")``.
        actor: Encoder, policy heads and distribution: writes the action and its log-probability.
        critic: The value head alone. It reads the features that the actor has already computed,
            which halves an update and leaves loss and gradient unchanged.
    """

    def __init__(self, factory: NetworkFactory) -> None:
        super().__init__()
        self.encoder = factory.encoder()
        self.actor = factory.actor(self.encoder)
        self.critic = factory.critic()


MakeFactory = Callable[[str, TeamSpec, Any], NetworkFactory]


NETWORKS: ChoiceRegistry[NetworkCfg, MakeFactory] = ChoiceRegistry("network", "algo.network")
"""Networks by name; a factory takes (team, spec, numbers)."""


def register_network(name: str, cfg_type: type[NetworkCfg], factory: MakeFactory) -> None:
    """Make a network known under `name`, the value of ``algo.network.name``.

    Raises:
        ValueError: If another network has the name, or the default of ``cfg_type.name`` differs.
    """
    NETWORKS.register(name, cfg_type, factory)


def make_network(team: str, spec: TeamSpec, cfg: NetworkCfg) -> TeamNetwork:
    """Return the network of a team as `cfg` describes it.

    Parameters of encoders in ``cfg.frozen`` do not require gradients: an optimiser takes those
    that do.

    Raises:
        ValueError: If there is no network called ``cfg.name``, or no encoder of a frozen sense.
    """
    network = TeamNetwork(find_network(team, spec, cfg))
    freeze(network.encoder, cfg, team)
    return network


def find_network(team: str, spec: TeamSpec, cfg: NetworkCfg) -> NetworkFactory:
    """Return what makes the parts of a team's network as `cfg` describes it.

    Raises:
        ValueError: If there is no network called ``cfg.name``, or `cfg` is not of its type.
    """
    return NETWORKS.factory_of(cfg)(team, spec, cfg)


def freeze(encoder: nn.Module, cfg: NetworkCfg, team: str) -> None:
    """Let the encoders of the senses in ``cfg.frozen`` require no gradients.

    Raises:
        ValueError: If there is no encoder of one of them.
    """
    for frozen in encoders_of(encoder, cfg.frozen, f"algo.network.frozen of team {team!r}"):
        frozen.requires_grad_(False)


def trainable(network: nn.Module) -> list[nn.Parameter]:
    """Return the parameters that an optimiser changes: all that are not frozen."""
    return [parameter for parameter in network.parameters() if parameter.requires_grad]


def check_same_network(cfg: NetworkCfg, stored: NetworkCfg, left_out: Collection[str] = ()) -> None:
    """Check that two configurations describe the same parameters.

    Args:
        cfg: A configuration.
        stored: That of the run to copy from.
        left_out: Fields that may differ.

    Raises:
        ValueError: If they differ; the message names the fields.
    """
    left_out = {*cfg.not_parameters, *left_out}
    check_same_settings("network", vars(cfg), vars(stored), left_out)


def check_same_settings(
    what: str,
    new: Mapping[str, Any],
    old: Mapping[str, Any],
    left_out: Collection[str] = (),
    hint: str = "",
) -> None:
    """Check that two runs have the same settings.

    Args:
        what: What they describe.
        new: Settings of this run by name.
        old: Those of the stored run.
        left_out: Names that may differ.
        hint: End of the message.

    Raises:
        ValueError: If they differ; the message names the settings.
    """
    differing = [
        f"{name}={old.get(name, 'absent')} in the stored run, {new.get(name, 'absent')} in this one"
        for name in {**new, **old}
        if name not in left_out and old.get(name) != new.get(name)
    ]
    if differing:
        raise ValueError(f"another {what}: {'; '.join(differing)}{hint}")


def copy_actor(here: Algorithm, other: Algorithm) -> None:
    """Copy the actor of another algorithm, with or without a `NetworkCfg`.

    Raises:
        ValueError: If the parameters do not fit or would be another function.
    """
    cfg, stored = here.network_cfg, other.network_cfg
    if isinstance(cfg, NetworkCfg) and isinstance(stored, NetworkCfg):
        check_same_network(cfg, stored, cfg.critics_only)
    new, old = ({"algo.policy_hidden": list(each.policy_hidden)} for each in (here, other))
    check_same_settings("actor", new, old, hint="; actors of PPO have []")
    copy_parameters(here.actor, other.actor)
