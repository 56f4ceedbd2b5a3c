"""Critics that read an action: the values of off-policy algorithms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import partial

import torch
from torch import Tensor, nn
from torchrl.modules import BatchRenorm1d

from veca_marl.algos.networks.factory import (
    NetworkCfg,
    NetworkFactory,
    find_network,
    freeze,
)
from veca_marl.algos.networks.layers import CRITIC_GAIN, PerAgent, perceptron
from veca_marl.algos.specs import TeamSpec


class Normalisation(Enum):
    """Normalisation before each activation of the critics' hidden layers.

    Attributes:
        none: No normalisation.
        layer: Layer normalisation (Ba et al. 2016).
        batch_renorm: Batch renormalisation (Ioffe 2017), for critics without target networks.
    """

    none = "none"
    layer = "layer"
    batch_renorm = "batch_renorm"


_MOMENTUM = 0.01  # weight of a batch in the running statistics (Bhatt et al. 2024)


class BatchRenorm(nn.Module):
    """TorchRL's `BatchRenorm1d` for inputs ``(..., features)``.

    The running statistics, which the policy's loss uses, are the mean over all batches until
    TorchRL's moving average, which forgets one hundredth with each batch, is the longer one.
    TorchRL starts that average at mean 0 and variance 1, which still are two thirds of it after 40
    batches: policies would be improved by values of units that are not normalised.

    Args:
        features: Width of the input.

    Attributes:
        counted: ``(...)``, False for entries that do not enter the statistics of a batch; None
            counts all. The output of the others is 0. See `statistics_of`.
    """

    counted: Tensor | None = None

    def __init__(self, features: int) -> None:
        super().__init__()
        self.layer = BatchRenorm1d(features)

    def forward(self, x: Tensor) -> Tensor:
        """Normalise over all dimensions but the last."""
        flat = x.flatten(0, -2)
        count = self.layer.num_batches_tracked
        self.layer.momentum = (1.0 / (count + 1)).clamp(min=_MOMENTUM)
        if not self.training or self.counted is None or self.counted.all():
            normalised: Tensor = self.layer(flat)
        else:
            counted = self.counted.flatten()
            normalised = torch.zeros_like(flat)
            if counted.sum() > 1:  # one entry has no variance
                normalised[counted] = self.layer(flat[counted])
        # TorchRL 0.14 counts on, and corrects twice as much after twice the steps of its warm-up
        count.copy_(count.clamp(max=self.layer.warmup_steps))
        return normalised.view_as(x)


_LAYERS: dict[Normalisation, type[nn.Module] | None] = {
    Normalisation.none: None,
    Normalisation.layer: nn.LayerNorm,
    Normalisation.batch_renorm: BatchRenorm,
}


@dataclass
class ActionValuesCfg:
    """Sizes of the critics.

    Attributes:
        critics: Number of critics; targets use the smallest of their values (clipped double
            Q-learning, Fujimoto et al. 2018).
        hidden: Widths of the hidden layers of each critic, on top of the encoder.
        normalisation: Normalisation of the hidden layers.
    """

    critics: int = 2
    hidden: list[int] = field(default_factory=lambda: [256, 256])
    normalisation: Normalisation = Normalisation.none

    def __post_init__(self) -> None:
        if self.critics < 1:
            raise ValueError(f"critic.critics must be at least 1, got {self.critics}")
        if any(width < 1 for width in self.hidden):
            raise ValueError(f"critic.hidden: widths must be positive, got {list(self.hidden)}")


class ActionValues(nn.Module):
    """Values of a team's actions: one for each combination of the discrete choices.

    The continuous parts of the action are an input. Every combination of the discrete parts has
    an output, so that an expectation over them is exact (Delalleau et al. 2019, "Discrete and
    continuous action representation for practical RL in video games"); without discrete parts
    there is one output.

    A central critic also reads the mean, over the other agents of the team that are present, of
    their features and actions (discrete parts one-hot).

    Args:
        factory: Makes the networks of the team.
        cfg: Sizes.

    Attributes:
        combinations: Number of outputs, the product of the numbers of choices.
        central: Whether the critics read what the other agents observe and do.
    """

    def __init__(self, factory: NetworkFactory, cfg: ActionValuesCfg) -> None:
        super().__init__()
        if factory.critic_reads_state:
            raise ValueError(
                "algo.network.critic=state is for PPO, whose batches hold the global state; "
                "choices for SAC: own, central"
            )
        layouts = factory.spec.actions.values()
        vector = sum(layout.size for layout in layouts if not layout.discrete)
        choices = [layout.size for layout in layouts if layout.discrete]
        self.combinations = math.prod(choices)
        self.central = factory.central_critic
        inputs = factory.features + vector
        if self.central:
            inputs += factory.features + vector + sum(choices)
        make = partial(
            perceptron,
            inputs,
            cfg.hidden,
            self.combinations,
            gain=CRITIC_GAIN,
            norm=_LAYERS[cfg.normalisation],
        )
        self.critics = nn.ModuleList(factory.per_agent(make) for _ in range(cfg.critics))

    def forward(self, features: Tensor, vector: Tensor, others: Tensor | None = None) -> Tensor:
        """Return values ``(critics, ..., agents, combinations)``.

        Args:
            features: ``(..., agents, F)``.
            vector: Continuous parts of the action, joined: ``(..., agents, A)``, A may be 0.
            others: What `mean_of_others` returned; for central critics.
        """
        inputs = [features, vector] if others is None else [features, vector, others]
        joined = torch.cat(inputs, dim=-1)
        return torch.stack([critic(joined) for critic in self.critics])


@contextmanager
def statistics_of(values: ActionValues, counted: Tensor) -> Iterator[None]:
    """Let batch normalisation of the critics use the entries alone that count.

    Args:
        values: The critics.
        counted: ``(..., agents)``, False for entries whose values are not used.
    """
    layers = list(_with_counted(values, counted))
    for layer, own in layers:
        layer.counted = own
    try:
        yield
    finally:
        for layer, _ in layers:
            layer.counted = None


def _with_counted(values: ActionValues, counted: Tensor) -> Iterator[tuple[BatchRenorm, Tensor]]:
    """Yield the normalisations of all critics, each with the entries that it reads."""
    for critic in values.critics:
        parts = [(critic, counted)]
        if isinstance(critic, PerAgent):
            parts = [(own, counted[..., i : i + 1]) for i, own in enumerate(critic.agents)]
        for module, own in parts:
            yield from ((m, own) for m in module.modules() if isinstance(m, BatchRenorm))


def mean_of_others(arrays: Tensor, mask: Tensor | None) -> Tensor:
    """Return for each agent the mean over the other agents that are present; zeros if none is.

    Args:
        arrays: ``(..., agents, F)``.
        mask: ``(..., agents)``, False for agents that are eliminated; None for none.
    """
    present = torch.ones_like(arrays[..., :1], dtype=torch.bool)
    if mask is not None:
        present = mask.unsqueeze(-1)
    counted = torch.where(present, arrays, torch.zeros_like(arrays))
    total = counted.sum(-2, keepdim=True) - counted
    count = present.sum(-2, keepdim=True) - present.long()
    return total / count.clamp_min(1)


class ActorCritics(nn.Module):
    """Actor and action values of one team over a shared encoder.

    Attributes:
        encoder: Writes ``(team, "features")``.
        actor: Encoder, policy heads and distribution.
        values: The critics, which read features and actions.
    """

    def __init__(
        self, factory: NetworkFactory, critic: ActionValuesCfg, policy_hidden: list[int]
    ) -> None:
        super().__init__()
        self.encoder = factory.encoder()
        self.actor = factory.actor(self.encoder, policy_hidden)
        self.values = ActionValues(factory, critic)


def make_actor_critics(
    team: str,
    spec: TeamSpec,
    cfg: NetworkCfg,
    critic: ActionValuesCfg,
    policy_hidden: list[int],
) -> ActorCritics:
    """Return the network of a team.

    Args:
        team: Name of the team.
        spec: Its arrays.
        cfg: Which encoder, and its numbers.
        critic: Sizes of the critics.
        policy_hidden: Widths of the hidden layers between features and policy heads.

    Raises:
        ValueError: If there is no network called ``cfg.name``, or no encoder of a frozen sense.
    """
    network = ActorCritics(find_network(team, spec, cfg), critic, policy_hidden)
    freeze(network.encoder, cfg, team)
    return network
