"""The losses of SAC for continuous, discrete and mixed actions of a team."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase, TensorDictParams
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.objectives.common import LossModule

from veca_marl.algos.networks.action_values import ActionValues, ActorCritics, mean_of_others
from veca_marl.algos.sac.config import EncoderGradient
from veca_marl.algos.sac.joint_action import JointAction, Proposed
from veca_marl.algos.sac.masks import masked_mean
from veca_marl.algos.sac.readers import FeatureReader, StepReader
from veca_marl.algos.sac.temperature import Temperatures
from veca_marl.algos.sac.windows import Transitions


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


class _Critic(nn.Module):
    """The modules that have a copy which gives the targets."""

    def __init__(self, encoder: TensorDictModuleBase, values: ActionValues) -> None:
        super().__init__()
        self.encoder: TensorDictModuleBase
        self.values: ActionValues
        self.encoder, self.values = encoder, values


class TeamSACLoss(LossModule):
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
    """

    critic: _Critic
    critic_params: TensorDictParams
    target_critic_params: TensorDictParams

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
        self.in_keys: list[str] = []  # it reads `Transitions`, not a TensorDict
        self.out_keys: list[str] = []
        self._team, self._action = team, action
        critic = _Critic(network.encoder, network.values)
        self.convert_to_functional(critic, "critic", create_target_params=True)
        self.policy = network.actor[1:]  # heads and distribution, without the encoder
        self.temperatures = temperatures
        self._encoder_gradient = encoder_gradient
        self._reader = reader or StepReader(team)

    def forward(self, batch: Transitions) -> Losses:
        """Return the losses of a batch."""
        features, after = self._reader.online(self.critic.encoder, batch)
        target = self._target(batch, after)
        error, value = self._critic_error(batch.first, features, target)
        if self._encoder_gradient is EncoderGradient.critic:
            policy_features = features.detach()
        else:
            policy_features = features
        proposed = self._propose(policy_features)
        with self.critic_params.data.to_module(self.critic):  # no gradient to the critics
            soft_value = self._soft_value(batch.first, features.detach(), proposed)
        counted = batch.counted
        entropy = sum(proposed.entropies.values(), torch.zeros(()))
        return Losses(
            critic=masked_mean(error, counted),
            policy=-masked_mean(soft_value, counted),
            temperature=self.temperatures.loss(proposed.entropies, counted),
            measures={
                "value": masked_mean(value.detach(), counted),
                "entropy": masked_mean(entropy.detach(), counted),
            },
        )

    def _critic_error(
        self, rows: TensorDictBase, features: Tensor, target: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return squared errors summed over critics, and the critics' mean value."""
        taken = self._action.taken(rows)
        values = self._values(rows, features, taken.vector, taken.code)
        index = taken.combination.unsqueeze(-1).expand(*values.shape[:-1], 1)
        chosen = values.gather(-1, index).squeeze(-1)
        return (chosen - target).square().sum(0), chosen.mean(0)

    @torch.no_grad()
    def _target(self, batch: Transitions, after: Tensor) -> Tensor:
        """Return the values ``(B, agents)`` that the critics should give.

        Args:
            batch: The batch.
            after: Features after the rewards, which the policy reads.
        """
        proposed = self._propose(after)
        with self.target_critic_params.to_module(self.critic):
            features = self._reader.after(self.critic.encoder, batch)
            value = self._soft_value(batch.last, features, proposed)
        return batch.returns + batch.discount * value

    def _soft_value(self, rows: TensorDictBase, features: Tensor, proposed: Proposed) -> Tensor:
        code = self._action.sample_code(proposed) if self.critic.values.central else None
        values = self._values(rows, features, proposed.vector, code).amin(0)
        expected = (proposed.probabilities * values).sum(-1)
        return expected + self.temperatures.bonus(proposed.entropies)

    def _values(
        self, rows: TensorDictBase, features: Tensor, vector: Tensor, code: Tensor | None
    ) -> Tensor:
        """Return ``(critics, B, agents, combinations)``."""
        others = None
        if self.critic.values.central and code is not None:
            mask = rows.get((self._team, "mask"), None)
            others = mean_of_others(torch.cat([features, code], -1), mask)
        values: Tensor = self.critic.values(features, vector, others)
        return values

    def _propose(self, features: Tensor) -> Proposed:
        state = TensorDict({}, features.shape[:-2])
        state[self._team, "features"] = features
        return self._action.propose(self.policy.get_dist(state))
