"""REINFORCE for actions with any number of parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torchrl.objectives.value.functional import reward2go

from veca_marl.extend import (
    Algorithm,
    AlgorithmCfg,
    MultisenseCfg,
    NetworkCfg,
    action_log_prob,
    make_network,
    register_algorithm,
)


@dataclass
class GuidedReinforceCfg(AlgorithmCfg):
    """Numbers of REINFORCE.

    Attributes:
        network: Sizes of the network.
        learning_rate: Step size of Adam.
        gamma: Discount.
    """

    name: str = "guided_reinforce"
    network: NetworkCfg = field(default_factory=MultisenseCfg)
    learning_rate: float = 1e-3
    gamma: float = 0.99


class GuidedReinforce(Algorithm):
    """Policy gradient with normalised returns (Williams 1992)."""

    exact_resume = True

    def __init__(self, team, spec, cfg: GuidedReinforceCfg, device) -> None:
        self.team, self.cfg, self.device = team, cfg, device
        self.network = make_network(team, spec, cfg.network).to(device)
        self.optimizer = torch.optim.Adam(self.network.actor.parameters(), lr=cfg.learning_rate)

    @property
    def actor(self):
        return self.network.actor

    @property
    def measures(self):
        return ["policy_loss"]

    def learn(self, batch):
        batch = batch.to(self.device)
        reward, done = batch["next", self.team, "reward"], batch["next", self.team, "done"]
        returns = reward2go(reward, done, self.cfg.gamma, time_dim=1)
        returns = (returns - returns.mean()) / (returns.std() + 1e-6)
        log_prob = action_log_prob(self.actor.get_dist(batch), batch, self.team)
        loss = -(log_prob * returns.squeeze(-1)).mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        return {"policy_loss": float(loss.detach())}

    def state_dict(self):
        return {"network": self.network.state_dict(), "optimizer": self.optimizer.state_dict()}

    def load_state_dict(self, state):
        self.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])


register_algorithm("guided_reinforce", GuidedReinforceCfg, GuidedReinforce)
