"""The losses of SAC for continuous, discrete and mixed actions of a team."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn

from veca_marl.algos.networks.action_values import (
    ActionValues,
    ActorCritics,
    mean_of_others,
    statistics_of,
)
from veca_marl.algos.sac.config import Adaptation, EncoderGradient, TemperatureCfg
from veca_marl.algos.sac.joint_action import JointAction, Proposed, Taken
from veca_marl.algos.sac.readers import FeatureReader, StepReader
from veca_marl.algos.sac.replay import Transitions
from veca_marl.algos.specs import ActionLayout


def masked_mean(x: Tensor, counted: Tensor) -> Tensor:
    """Return the mean of `x` over the entries that are True in `counted`; 0 if there are none.

    Args:
        x: Any shape.
        counted: Shape that `x` has, or one that is broadcast to it.
    """
    counted = counted.expand_as(x)
    return torch.where(counted, x, torch.zeros_like(x)).sum() / counted.sum().clamp_min(1)


class Critic(nn.Module):
    """The modules from observations to action values.

    TorchRL's `LossModule` and `SoftUpdate` swap the parameters of one module by TensorDicts
    instead of copying it: a quarter of the processor time of an update of the default network.

    Args:
        encoder: Writes the features.
        values: Reads them.
    """

    encoder: TensorDictModuleBase
    values: ActionValues

    def __init__(self, encoder: TensorDictModuleBase, values: ActionValues) -> None:
        super().__init__()
        self.encoder, self.values = encoder, values

    def copy(self) -> Critic:
        """Return an equal one with parameters of its own, which are never learnt."""
        return deepcopy(self).requires_grad_(False)

    @torch.no_grad()
    def approach(self, other: Critic, share: float) -> None:
        """Move all parameters towards those of `other`, and copy its buffers.

        Args:
            other: A critic with the same modules.
            share: Share of the difference, in (0, 1]; 1 copies.
        """
        torch._foreach_lerp_([*self.parameters()], [*other.parameters()], share)
        for own, new in zip(self.buffers(), other.buffers(), strict=True):
            own.copy_(new)


@contextmanager
def constant(module: nn.Module) -> Iterator[None]:
    """Let gradients flow through `module` but not into it, and its statistics stay as they are."""
    learnt = [parameter for parameter in module.parameters() if parameter.requires_grad]
    for parameter in learnt:
        parameter.requires_grad_(False)
    module.eval()  # batch normalisation uses its running statistics
    try:
        yield
    finally:
        module.train()
        for parameter in learnt:
            parameter.requires_grad_(True)


class Temperatures(nn.Module):
    """A temperature alpha for each part of the action, fixed or learnt.

    Args:
        actions: Part to its layout.
        cfg: Initial value, adaptation and target entropies.

    Attributes:
        targets: Part to its target entropy in nats.
    """

    def __init__(self, actions: Mapping[str, ActionLayout], cfg: TemperatureCfg) -> None:
        super().__init__()
        self.targets = {part: _target(layout, cfg) for part, layout in actions.items()}
        learnt = cfg.adaptation is Adaptation.automatic
        self._least = math.log(cfg.minimum) if cfg.minimum > 0.0 else -math.inf
        self._logs = nn.ParameterDict(
            {
                part: nn.Parameter(torch.tensor(math.log(cfg.initial)), requires_grad=learnt)
                for part in actions
            }
        )

    def alphas(self) -> dict[str, Tensor]:
        """Return the temperature of each part, without gradient."""
        return {part: log.detach().exp() for part, log in self._logs.items()}

    @torch.no_grad()
    def project(self) -> None:
        """Raise temperatures below the minimum to it; to be called after each gradient step."""
        for log in self._logs.values():
            log.clamp_(min=self._least)

    def bonus(self, entropies: Mapping[str, Tensor]) -> Tensor:
        """Return the sum of entropies, weighted by their temperatures."""
        alphas = self.alphas()
        return sum((alphas[part] * entropy for part, entropy in entropies.items()), torch.zeros(()))

    def loss(self, entropies: Mapping[str, Tensor], counted: Tensor) -> Tensor:
        """Return the loss that raises a temperature where the entropy is below its target.

        ``log(alpha) * (entropy - target)`` instead of ``alpha * (entropy - target)``: the form of
        the authors' code and of TorchRL's `SACLoss`.

        Args:
            entropies: Part to its entropy ``(..., agents)``.
            counted: ``(..., agents)``, True for the entries that count.
        """
        losses = [
            self._logs[part] * masked_mean(entropy.detach() - self.targets[part], counted)
            for part, entropy in entropies.items()
        ]
        return torch.stack(losses).sum()


def _target(layout: ActionLayout, cfg: TemperatureCfg) -> float:
    if layout.discrete:
        return cfg.entropy_of_choices * math.log(layout.size)
    return cfg.entropy_per_dimension * layout.size


@dataclass(frozen=True)
class Losses:
    """Losses of one update, scalars with gradients, and what is measured.

    Attributes:
        critic: Mean squared error of the critics, summed over them.
        policy: Loss of the policy.
        temperature: Loss of the temperatures; without gradient if they are fixed.
        measures: Name to a number without gradient.
    """

    critic: Tensor
    policy: Tensor
    temperature: Tensor
    measures: dict[str, Tensor]


class TeamSACLoss(nn.Module):
    """Soft actor-critic with an exact expectation over discrete parts of the action.

    The critics read the continuous parts of an action and give a value for each combination k of
    the discrete ones. With the parts h of the action, the soft value of an observation is::

        V = sum_k pi(k) min_critics Q(vector, k) + sum_h alpha_h H_h

    where the vector is one reparametrised sample, H_h the exact entropy of a discrete part or
    ``-log pi(vector)`` of a continuous one. The policy maximises V, the critics regress onto
    ``returns + discount * V`` of the target network.

    Sources: Haarnoja et al. 2018 ("Soft actor-critic algorithms and applications"); Christodoulou
    2019 ("Soft actor-critic for discrete action settings"); Delalleau et al. 2019 ("Discrete and
    continuous action representation for practical RL in video games"). Without discrete parts it
    equals TorchRL's `SACLoss`, without continuous ones its `DiscreteSACLoss`; neither accepts an
    action of both kinds.

    Args:
        team: Name of the team.
        network: Its network.
        action: How its action is joined.
        temperatures: Weights of the entropy.
        encoder_gradient: Which loss trains the encoder.
        reader: Computes features of observations.

    Attributes:
        averages: Whether a moving average of the critics gives the targets.
        critic: Encoder and critics.
        target: Their moving average, or `critic` itself.
    """

    averages: ClassVar[bool] = True

    def __init__(
        self,
        team: str,
        network: ActorCritics,
        action: JointAction,
        temperatures: Temperatures,
        encoder_gradient: EncoderGradient,
        reader: FeatureReader | None = None,
    ) -> None:
        super().__init__()
        self._team, self._action = team, action
        self.critic = Critic(network.encoder, network.values)
        self.target = self.critic.copy() if self.averages else self.critic
        self.policy = network.actor[1:]  # heads and distribution, without the encoder
        self.temperatures = temperatures
        self._encoder_gradient = encoder_gradient
        self._reader = reader or StepReader(team)

    def forward(self, batch: Transitions) -> Losses:
        """Return the losses of a batch."""
        features, after = self._reader.online(self.critic.encoder, batch)
        values, target = self._regression(batch, features, after)
        error = (values - target).square().sum(0)
        if self._encoder_gradient is EncoderGradient.critic:
            policy_features = features.detach()
        else:
            policy_features = features
        proposed = self._propose(policy_features)
        soft_value = self._evaluate(batch.first, features.detach(), proposed)
        counted = batch.counted
        entropy = sum(proposed.entropies.values(), torch.zeros(()))
        return Losses(
            critic=masked_mean(error, counted),
            policy=-masked_mean(soft_value, counted),
            temperature=self.temperatures.loss(proposed.entropies, counted),
            measures={
                "value": masked_mean(values.detach().mean(0), counted),
                "entropy": masked_mean(entropy.detach(), counted),
            },
        )

    def _regression(
        self, batch: Transitions, features: Tensor, after: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the values of the actions taken, and what they should be.

        Args:
            batch: The batch.
            features: Features before the rewards.
            after: Features after the rewards, which the policy reads.

        Returns:
            Values ``(critics, B, agents)`` with gradient, targets ``(B, agents)`` without.
        """
        taken = self._action.taken(batch.first)
        values = self.critic.values(*self._inputs(batch.first, features, taken.vector, taken.code))
        return _chosen(values, taken), self._target(batch, after)

    @torch.no_grad()
    def _target(self, batch: Transitions, after: Tensor) -> Tensor:
        proposed = self._propose(after)
        features = self._reader.after(self.target.encoder, batch)
        values = self.target.values(*self._proposed_inputs(batch.last, features, proposed))
        return batch.returns + batch.discount * self._soft_value(values, proposed)

    def _evaluate(self, rows: TensorDictBase, features: Tensor, proposed: Proposed) -> Tensor:
        """Return the soft value of proposed actions, without gradient to the critics."""
        inputs = self._proposed_inputs(rows, features, proposed)
        with constant(self.critic.values):
            values = self.critic.values(*inputs)
        return self._soft_value(values, proposed)

    def _soft_value(self, values: Tensor, proposed: Proposed) -> Tensor:
        """Return the soft value ``(B, agents)`` from ``(critics, B, agents, combinations)``."""
        expected = (proposed.probabilities * values.amin(0)).sum(-1)
        return expected + self.temperatures.bonus(proposed.entropies)

    def _proposed_inputs(
        self, rows: TensorDictBase, features: Tensor, proposed: Proposed
    ) -> tuple[Tensor, ...]:
        code = self._action.sample_code(proposed) if self.critic.values.central else None
        return self._inputs(rows, features, proposed.vector, code)

    def _inputs(
        self, rows: TensorDictBase, features: Tensor, vector: Tensor, code: Tensor | None
    ) -> tuple[Tensor, ...]:
        """Return what `ActionValues` reads."""
        if not self.critic.values.central or code is None:
            return features, vector
        mask = rows.get((self._team, "mask"), None)
        return features, vector, mean_of_others(torch.cat([features, code], -1), mask)

    def _propose(self, features: Tensor) -> Proposed:
        state = TensorDict({}, features.shape[:-2])
        state[self._team, "features"] = features
        return self._action.propose(self.policy.get_dist(state))


class TeamCrossQLoss(TeamSACLoss):
    """SAC whose critics give their own targets.

    The critics read both ends of each window in one batch, so that their batch normalisation
    sees actions of the replay buffer and of the policy in the same proportion. Entries that do not
    count, such as those of eliminated agents, do not enter its statistics.

    Source: Bhatt et al. 2024, "CrossQ: batch normalization in deep reinforcement learning for
    greater sample efficiency and simplicity". For continuous actions it equals TorchRL's
    `CrossQLoss`.
    """

    averages = False

    def _regression(
        self, batch: Transitions, features: Tensor, after: Tensor
    ) -> tuple[Tensor, Tensor]:
        """See `TeamSACLoss`."""
        taken = self._action.taken(batch.first)
        with torch.no_grad():
            proposed = self._propose(after)
        first = self._inputs(batch.first, features, taken.vector, taken.code)
        last = self._proposed_inputs(batch.last, after, proposed)
        joined = [torch.cat(pair) for pair in zip(first, last, strict=True)]
        with statistics_of(self.critic.values, self._counted_at_both_ends(batch)):
            values, following = self.critic.values(*joined).chunk(2, dim=1)
        soft_value = self._soft_value(following.detach(), proposed)
        return _chosen(values, taken), batch.returns + batch.discount * soft_value

    def _counted_at_both_ends(self, batch: Transitions) -> Tensor:
        """Return ``(2 B, agents)``, False where the value at that end of a window is not used."""
        present = batch.last.get((self._team, "mask"), None)
        last = batch.counted if present is None else batch.counted & present
        return torch.cat([batch.counted, last])


def _chosen(values: Tensor, taken: Taken) -> Tensor:
    """Return the values ``(critics, B, agents)`` of the combinations that were taken."""
    index = taken.combination.unsqueeze(-1).expand(*values.shape[:-1], 1)
    return values.gather(-1, index).squeeze(-1)
