"""What learns one team: proximal policy optimisation with the numbers of the paper's table."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import nn
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.objectives import KLAdaptiveLR
from torchrl.objectives.value.functional import vec_generalized_advantage_estimate

from veca_marl.algos.networks.actor_critic import NetworkCfg, TeamNetwork
from veca_marl.algos.networks.policy_heads import log_prob_keys
from veca_marl.algos.ppo.losses import VALID, ExactKLPPOLoss
from veca_marl.algos.specs import TeamSpec, action_key

_REPORTED = {  # name in the logs: name in the loss
    "policy_loss": "loss_objective",
    "value_loss": "loss_critic",
    "entropy": "entropy",
    "kl": "kl_approx",
    "clip_fraction": "clip_fraction",
    "explained_variance": "explained_variance",
}


@dataclass
class PPOCfg:
    """Numbers of PPO; the defaults are the paper's table where it speaks.

    Attributes:
        network: Sizes of the network.
        gamma: Discount.
        gae_lambda: Lambda of the generalised advantage estimate (Schulman et al. 2016).
        clip: Clipping range of the probability ratio.
        entropy_coefficient: Weight of the entropy bonus.
        value_coefficient: Weight of the value loss.
        max_gradient_norm: Gradients are scaled down to this norm.
        epochs: Passes over each batch.
        minibatches: Parts of the batch in one pass.
        learning_rate: Where the adaptive rate starts (ours).
        target_kl: The rate is divided by 1.5 above twice this divergence, multiplied by 1.5 below
            half of it: the rule of rl_games with its target of 0.008 (ours; the paper says
            "adaptive to the KL divergence").
        min_learning_rate: Lower bound of the rate.
        max_learning_rate: Upper bound of the rate.
    """

    network: NetworkCfg = field(default_factory=NetworkCfg)
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_coefficient: float = 0.03
    value_coefficient: float = 0.5
    max_gradient_norm: float = 5.0
    epochs: int = 4
    minibatches: int = 4
    learning_rate: float = 3e-4
    target_kl: float = 0.008
    min_learning_rate: float = 1e-6
    max_learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("gamma", "gae_lambda"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"algo.{name} must be in [0, 1], got {getattr(self, name)}")
        for name in ("clip", "max_gradient_norm", "target_kl", "min_learning_rate"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"algo.{name} must be positive, got {getattr(self, name)}")
        for name in ("epochs", "minibatches"):
            if getattr(self, name) < 1:
                raise ValueError(f"algo.{name} must be at least 1, got {getattr(self, name)}")
        if not self.min_learning_rate <= self.learning_rate <= self.max_learning_rate:
            raise ValueError(
                f"algo.learning_rate must be in [{self.min_learning_rate}, "
                f"{self.max_learning_rate}], got {self.learning_rate}"
            )


class TeamLearner:
    """Network, loss, optimiser and learning rate of one team.

    Args:
        team: The team's name: the first part of all its keys.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: PPOCfg, device: torch.device) -> None:
        self.team, self.cfg, self._masked = team, cfg, spec.masked
        self.network = TeamNetwork(team, spec, cfg.network).to(device)
        self.loss = _make_loss(team, self.network, cfg)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=cfg.learning_rate)
        self.schedule = KLAdaptiveLR(
            self.optimizer,
            target_kl=cfg.target_kl,
            factor=1.5,
            min_lr=cfg.min_learning_rate,
            max_lr=cfg.max_learning_rate,
        )
        self.batch_keys = [
            *self.network.trunk.in_keys,
            *self.network.distribution_keys,
            *(action_key(team, part) for part in spec.actions),
            *log_prob_keys(team, spec.actions),
            *([(team, "mask")] if spec.masked else []),
        ]
        self._memory: TensorDictReplayBuffer | None = None

    def prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """Return what this team learns from in a batch ``(worlds, steps)``, in the same shape."""
        rows = batch.select(*self.batch_keys)
        rows[self.team].update(self.advantages(batch))
        return rows

    @torch.no_grad()
    def advantages(self, batch: TensorDictBase) -> TensorDict:
        """Return advantage and value target, both ``(worlds, steps, agents, 1)``.

        Values come from the features that acting left behind, except after the last step of an
        episode or of the batch: what comes next there is not in the batch's observations.
        """
        team, device = self.team, next(self.network.parameters()).device
        value = self.network.critic.module(batch[team, "features"].to(device))
        following = torch.zeros_like(value)
        following[:, :-1] = value[:, 1:]
        cut = batch["next", "done"].squeeze(-1).clone()
        cut[:, -1] = True
        last = batch["next"].select((team, "observation"))[cut].to(device)
        following[cut.to(device)] = self.network.critic(self.network.trunk(last))[
            team, "state_value"
        ]
        advantage, target = vec_generalized_advantage_estimate(
            self.cfg.gamma,
            self.cfg.gae_lambda,
            *(
                array.to(device).squeeze(-1)
                for array in (
                    value,
                    following,
                    batch["next", team, "reward"],
                    batch["next", team, "done"],
                    batch["next", team, "terminated"],
                )
            ),
        )
        return TensorDict(
            {"advantage": advantage.unsqueeze(-1), "value_target": target.unsqueeze(-1)},
            batch.batch_size,
        )

    def learn(self, rows: TensorDictBase) -> dict[str, float]:
        """Make all epochs over rows ``(n,)`` and return the mean of each measure."""
        memory = self._fill_memory(rows)
        measured: list[dict[str, float]] = []
        for _ in range(self.cfg.epochs):
            epoch = [self.step(minibatch) for minibatch in memory]
            self.schedule.step(_mean(epoch)["kl"])
            measured += epoch
        return _mean(measured) | {"learning_rate": self.schedule.get_last_lr()[0]}

    def pause(self) -> dict[str, float]:
        """Return what `learn` returns, with nothing measured."""
        return dict.fromkeys([*_REPORTED, "gradient_norm", "learning_rate"], math.nan)

    def _fill_memory(self, rows: TensorDictBase) -> TensorDictReplayBuffer:
        if self._memory is None:
            self._memory = TensorDictReplayBuffer(
                storage=LazyTensorStorage(len(rows), device=rows.device),
                sampler=SamplerWithoutReplacement(drop_last=True),
                batch_size=len(rows) // self.cfg.minibatches,
            )
        self._memory.empty()
        self._memory.extend(rows)
        return self._memory

    def step(self, minibatch: TensorDictBase) -> dict[str, float]:
        """Take one gradient step and return what was measured."""
        if self._masked:  # who was out decided nothing: its rows teach nothing
            minibatch[VALID] = minibatch[self.team, "mask"].unsqueeze(-1)
        out = self.loss(minibatch)
        loss = out["loss_objective"] + out["loss_critic"] + out["loss_entropy"]
        self.optimizer.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.cfg.max_gradient_norm)
        if not torch.isfinite(norm):
            raise FloatingPointError(
                f"team {self.team!r}: the gradient is {norm.item()}; observations or rewards "
                "are not finite, or the learning rate is too high"
            )
        self.optimizer.step()
        measured = {name: float(out[key].detach().mean()) for name, key in _REPORTED.items()}
        return measured | {"gradient_norm": float(norm)}

    def state_dict(self) -> dict[str, Any]:
        """Return all that continues the learning exactly."""
        return {
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "schedule": self.schedule.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        for name in ("network", "optimizer", "schedule"):
            getattr(self, name).load_state_dict(state[name])


def _make_loss(team: str, network: TeamNetwork, cfg: PPOCfg) -> ExactKLPPOLoss:
    loss = ExactKLPPOLoss(
        network.actor,
        network.critic,
        clip_epsilon=cfg.clip,
        entropy_coeff=cfg.entropy_coefficient,
        critic_coeff=cfg.value_coefficient,
        loss_critic_type="l2",
        normalize_advantage=True,
        normalize_advantage_exclude_dims=(-2,),  # each agent of the team by itself
        functional=False,
    )
    loss.set_keys(
        reward=(team, "reward"),
        done=(team, "done"),
        terminated=(team, "terminated"),
        value=(team, "state_value"),
        advantage=(team, "advantage"),
        value_target=(team, "value_target"),
    )
    return loss


def _mean(measures: list[dict[str, float]]) -> dict[str, float]:
    return {name: sum(m[name] for m in measures) / len(measures) for name in measures[0]}
