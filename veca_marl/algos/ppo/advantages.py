"""Advantages and value targets of one team."""

from __future__ import annotations

from enum import Enum

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.objectives.value.functional import (
    generalized_advantage_estimate,
    vec_generalized_advantage_estimate,
)

from veca_marl.algos.networks.factory import TeamNetwork
from veca_marl.algos.networks.layers import team_mean


class Credit(Enum):
    """What counts for an agent after its elimination, while its team plays on.

    Attributes:
        nothing: Its return ends.
        team: Its return goes on with the mean value of the agents that are left, so that a
            sacrifice that lets the team win is reinforced.
    """

    nothing = "nothing"
    team = "team"


@torch.no_grad()
def advantages(
    network: TeamNetwork,
    batch: TensorDictBase,
    team: str,
    gamma: float,
    gae_lambda: float,
    credit: Credit = Credit.nothing,
) -> TensorDict:
    """Return advantage and value target, both ``(worlds, steps, agents, 1)``.

    Values are computed from the features that the actor wrote while collecting, except after the
    last step of an episode or of the batch: the observation that follows is not in the batch's
    own ones. (TorchRL's `GAE` module would run the encoder over every observation once more.)

    Args:
        network: The team's network.
        batch: Experience ``(worlds, steps)``.
        team: Name of the team.
        gamma: Discount.
        gae_lambda: Lambda of the estimate.
        credit: What counts after an elimination.
    """
    device = next(network.parameters()).device
    value = network.critic(batch.select(*network.critic.in_keys).to(device))[team, "state_value"]
    following = torch.zeros_like(value)
    following[:, :-1] = value[:, 1:]
    cut = batch["next", "done"].squeeze(-1).clone()
    cut[:, -1] = True
    following[cut.to(device)] = _values_after(network, batch["next"], cut, team, device)
    reward, done, terminated = (array.to(device) for array in _outcome(batch, team))
    if credit is Credit.team and "mask" in batch["next", team].keys():  # noqa: SIM118
        left = batch["next", team, "mask"].to(device)
        eliminated = terminated & ~batch["next", "terminated"].unsqueeze(-1).to(device)
        following = torch.where(eliminated, team_mean(following, left), following)
        terminated = terminated & ~eliminated
    # TorchRL's vectorised estimate raises an error where no later step counts
    estimate = (
        vec_generalized_advantage_estimate
        if gamma * gae_lambda > 0.0
        else generalized_advantage_estimate
    )
    advantage, target = estimate(
        gamma,
        gae_lambda,
        *(array.squeeze(-1) for array in (value, following, reward, done, terminated)),
    )
    return TensorDict(
        {"advantage": advantage.unsqueeze(-1), "value_target": target.unsqueeze(-1)},
        batch.batch_size,
    )


def _values_after(
    network: TeamNetwork, following: TensorDictBase, cut: Tensor, team: str, device: torch.device
) -> Tensor:
    """Return the values of the observations that follow the steps in `cut`."""
    read = {*network.encoder.in_keys, *network.critic.in_keys} - {(team, "features")}
    last = following.select(*read)[cut].to(device)
    value: Tensor = network.critic(network.encoder(last))[team, "state_value"]
    return value


def _outcome(batch: TensorDictBase, team: str) -> tuple[Tensor, Tensor, Tensor]:
    """Return reward, done and terminated of each agent."""
    step = batch["next", team]
    return step["reward"], step["done"], step["terminated"]
