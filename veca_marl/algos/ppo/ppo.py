"""Proximal policy optimisation (Schulman et al. 2017) of one team, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn
from torchrl.objectives import KLAdaptiveLR

from veca_marl.algos.algorithm import Algorithm, AlgorithmCfg
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.imitation.term import ImitationCfg, ImitationTerm
from veca_marl.algos.networks.factory import (
    NetworkCfg,
    TeamNetwork,
    check_one_mode,
    check_same_network,
    copy_actor,
    make_network,
    trainable,
)
from veca_marl.algos.networks.layers import clip_norms, independent_parameters
from veca_marl.algos.networks.memory import memory_of
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.algos.ppo.advantages import Credit, advantages
from veca_marl.algos.ppo.losses import (
    VALID,
    TeamPPOLoss,
    check_entropy_coefficient,
    entropy_weights,
)
from veca_marl.algos.ppo.value_normalisation import NormalisedCritic, ValueNormalisation
from veca_marl.algos.sense_encoders import copy_parameters
from veca_marl.algos.specs import STATE, TeamSpec


@dataclass
class PPOCfg(AlgorithmCfg):
    """Numbers of PPO; the defaults are those of the paper's table where it gives them.

    Attributes:
        network: The network and its sizes.
        gamma: Discount.
        gae_lambda: Lambda of the generalised advantage estimate (Schulman et al. 2016).
        credit: What an agent is credited with after its elimination.
        clip: Clipping range of the probability ratio, in (0, 1].
        entropy_coefficient: Weight of the entropy bonus: a number for all parts of the action, or
            one for each of them: ``algo.entropy_coefficient={move:0.003,voice:0.03}``.
        value_coefficient: Weight of the value loss.
        value_normalisation: What the critic predicts, and in which unit its loss is measured.
        max_gradient_norm: Gradients are scaled down to this norm, those of agents with networks of
            their own each by itself.
        epochs: Passes over each batch.
        minibatches: Parts of the batch in one pass.
        sequence_steps: Steps through which gradients of a network with hidden state flow: its
            minibatches consist of sequences of this length, as many frames as otherwise. Divides
            collect.steps; not used without hidden state.
        learning_rate: Initial value of the adaptive rate of the actor and of the encoder that both
            heads read (ours).
        target_kl: Divergence per dimension of the action: a number of a vector, or a choice. The
            rate is divided by 1.5 above twice this divergence, multiplied by 1.5 below half of it:
            the rule of rl_games (the paper says "adaptive to the KL divergence"). Ours is its
            target of 0.008 for an action of two dimensions. The divergence of an action is the sum
            over its dimensions, so the target grows with their number. The divergence of a
            minibatch is measured before its step: it is 0 in the first step after collection,
            and with one epoch of one minibatch the rate stays.
        min_learning_rate: Lower bound of the rate.
        max_learning_rate: Upper bound of the rate.
        critic_learning_rate: Constant rate of the parameters of the critic alone (ours): the
            divergence of the policy says nothing about them.
        imitation: The term of imitation of a run with ``demonstrations=FOLDER``.
    """

    name: str = "ppo"
    network: NetworkCfg = field(default_factory=MultisenseCfg)
    gamma: float = 0.99
    gae_lambda: float = 0.95
    credit: Credit = Credit.nothing
    clip: float = 0.2
    entropy_coefficient: Any = 0.03  # float | dict[str, float], which OmegaConf cannot express
    value_coefficient: float = 0.5
    value_normalisation: ValueNormalisation = ValueNormalisation.none
    max_gradient_norm: float = 5.0
    epochs: int = 4
    minibatches: int = 4
    sequence_steps: int = 32
    learning_rate: float = 3e-4
    target_kl: float = 0.004
    min_learning_rate: float = 1e-6
    max_learning_rate: float = 1e-3
    critic_learning_rate: float = 1e-3
    imitation: ImitationCfg = field(default_factory=ImitationCfg)

    def __post_init__(self) -> None:
        for name in ("gamma", "gae_lambda"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"algo.{name} must be in [0, 1], got {getattr(self, name)}")
        if not 0.0 < self.clip <= 1.0:
            raise ValueError(f"algo.clip must be in (0, 1], got {self.clip}")
        for name in (
            "max_gradient_norm",
            "target_kl",
            "min_learning_rate",
            "critic_learning_rate",
        ):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"algo.{name} must be positive, got {getattr(self, name)}")
        for name in ("epochs", "minibatches", "sequence_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"algo.{name} must be at least 1, got {getattr(self, name)}")
        check_one_mode(self.network, "ppo")
        check_entropy_coefficient(self.entropy_coefficient)
        if not 0.0 <= self.value_coefficient < math.inf:
            raise ValueError(
                f"algo.value_coefficient must be finite, 0 or more, got {self.value_coefficient}"
            )
        if not self.min_learning_rate <= self.learning_rate <= self.max_learning_rate:
            raise ValueError(
                f"algo.learning_rate={self.learning_rate} must be in "
                f"[algo.min_learning_rate={self.min_learning_rate}, "
                f"algo.max_learning_rate={self.max_learning_rate}]"
            )

    def check_batch(self, worlds: int, steps: int) -> None:
        """See `AlgorithmCfg`: a minibatch has at least two frames, to normalise advantages."""
        length, unit = 1, "frames"
        if self.network.recurrent:
            check_sequences(self.sequence_steps, steps)
            length, unit = self.sequence_steps, f"sequences of {self.sequence_steps} steps"
        rows = worlds * steps // length
        if rows < self.minibatches:
            raise ValueError(
                f"a batch of {rows} {unit} cannot be split into algo.minibatches={self.minibatches}"
            )
        if rows // self.minibatches * length < 2:
            raise ValueError(
                f"algo.minibatches={self.minibatches} leaves one frame for a minibatch of a batch "
                f"of {worlds * steps}: one advantage has no standard deviation"
            )


def check_sequences(sequence_steps: int, steps: int) -> None:
    """Check that the steps of a batch are a multiple of those of a sequence.

    Raises:
        ValueError: If they are not.
    """
    if steps % sequence_steps:
        raise ValueError(
            f"algo.sequence_steps={sequence_steps} must divide collect.steps, got {steps}"
        )


def minibatches(rows: TensorDictBase, count: int) -> Iterator[TensorDictBase]:
    """Yield `count` equally large parts of `rows` in random order, without replacement.

    Rows that are left over are not in any part. `index_select` copies images five times as fast as
    the indexing by tensors of TorchRL's storages.

    Args:
        rows: Shape ``(n, ...)``.
        count: Number of parts, at most n.
    """
    size = len(rows) // count
    order = torch.randperm(len(rows), device=rows.device)
    for part in order[: size * count].split(size):
        select = partial(torch.index_select, dim=0, index=part)
        yield rows.apply(select, batch_size=[size, *rows.batch_size[1:]])


_MEASURES = {  # name in the logs: name in the loss
    "policy_loss": "loss_objective",
    "value_loss": "loss_critic",
    "entropy": "entropy",
    "kl": "kl_approx",
    "clip_fraction": "clip_fraction",
    "explained_variance": "explained_variance",
}


class PPO(Algorithm):
    """Network, loss, optimiser and learning rate of one team.

    A network with hidden state learns from sequences of ``cfg.sequence_steps``: gradients flow
    through a sequence, which starts from the state that was stored while collecting (truncated
    backpropagation through time). Other networks learn from single steps.

    Args:
        team: Name of the team: the first part of all its keys.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.
    """

    exact_resume = True

    def __init__(self, team: str, spec: TeamSpec, cfg: PPOCfg, device: torch.device) -> None:
        self.team, self.cfg, self._masked, self._device = team, cfg, spec.masked, device
        self.network = make_network(team, spec, cfg.network)
        self.normalised_critic = _normalise_values(team, self.network, cfg.value_normalisation)
        self.network.to(device)
        weights = entropy_weights(team, list(spec.actions), cfg.entropy_coefficient)
        self.loss = _make_loss(team, self.network, cfg, weights).to(device)
        if self.normalised_critic is not None:
            self.loss.value_norm = self.normalised_critic.statistics
        self._independent = independent_parameters([self.network])
        acting, valuing = _split_parameters(self.network)
        self.optimizer = torch.optim.Adam(acting, lr=cfg.learning_rate, fused=True)
        self.critic_optimizer = torch.optim.Adam(valuing, lr=cfg.critic_learning_rate, fused=True)
        self.schedule = KLAdaptiveLR(
            self.optimizer,
            target_kl=cfg.target_kl * sum(part.dimensions for part in spec.actions.values()),
            factor=1.5,
            min_lr=cfg.min_learning_rate,
            max_lr=cfg.max_learning_rate,
        )
        self._recurrent = memory_of(self.network.actor) is not None
        self._imitation = ImitationTerm(
            team, spec, self.network.actor, cfg.imitation, cfg.sequence_steps
        )
        self._batch_keys = _batch_keys(self.network, team, spec.masked)

    @property
    def network_cfg(self) -> NetworkCfg:
        """See `Algorithm`."""
        return self.cfg.network

    @property
    def actor(self) -> TensorDictModuleBase:
        """See `Algorithm`."""
        return self.network.actor

    @property
    def measures(self) -> list[str]:
        """See `Algorithm`."""
        return [*_MEASURES, "gradient_norm", "learning_rate", *self._imitation.measures]

    def take_demonstrations(self, demonstrations: Demonstrations) -> None:
        """See `Algorithm`: a term of imitation is added to the loss of the policy."""
        self._imitation.take(demonstrations)

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """See `Algorithm`: all epochs over one batch; each measure is a mean over them."""
        learnt = self.learn_rows(self.prepare(batch))
        self._imitation.frames += batch.numel()
        return learnt

    def prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """Return the rows that a batch consists of, on the device.

        They are steps, ``(worlds * steps,)``, or for a network with hidden state sequences,
        ``(worlds * steps / sequence_steps, sequence_steps)``.

        Raises:
            ValueError: If the steps of the batch cannot be split into sequences.
        """
        cfg = self.cfg
        rows = batch.select(*self._batch_keys)
        rows[self.team].update(
            advantages(self.network, batch, self.team, cfg.gamma, cfg.gae_lambda, cfg.credit)
        )
        if self._recurrent:
            check_sequences(cfg.sequence_steps, batch.shape[1])
            return rows.reshape(-1, cfg.sequence_steps).to(self._device)
        return rows.reshape(-1).to(self._device)

    def learn_rows(self, rows: TensorDictBase) -> dict[str, float]:
        """Make all epochs over `rows` and return the mean of each measure."""
        if self.normalised_critic is not None:
            targets = rows[self.team, "value_target"]
            targets = targets[rows[self.team, "mask"]] if self._masked else targets.flatten(0, -2)
            if len(targets):
                self.normalised_critic.update(targets)
        measured: list[dict[str, float]] = []
        for _ in range(self.cfg.epochs):
            parts = minibatches(rows, self.cfg.minibatches)
            epoch = [self.step(minibatch) for minibatch in parts if self._counts(minibatch)]
            measured += epoch
            # the divergence before the first step is 0 but for rounding, which is no measure of it
            if epoch and len(measured) > 1:
                self.schedule.step(_mean(epoch)["kl"])
        means = _mean(measured) if measured else self.idle()
        rate = {"learning_rate": self.schedule.get_last_lr()[0]}
        return means | rate | self._imitation.measures

    def _counts(self, minibatch: TensorDictBase) -> bool:
        """Return whether an agent is present in any row: there is nothing to learn otherwise."""
        return not self._masked or bool(minibatch[self.team, "mask"].any())

    def step(self, minibatch: TensorDictBase) -> dict[str, float]:
        """Take one gradient step and return what was measured.

        Raises:
            FloatingPointError: If the gradient or the loss is not finite.
        """
        if self._masked:
            minibatch[VALID] = minibatch[self.team, "mask"].unsqueeze(-1)
        out = self.loss(minibatch)
        loss = out["loss_objective"] + out["loss_critic"] + out["loss_entropy"]
        if self._imitation.active:
            loss = loss + self._imitation.loss(self._device)
        self.optimizer.zero_grad()
        self.critic_optimizer.zero_grad()
        loss.backward()
        norm = clip_norms(self._independent, self.cfg.max_gradient_norm)
        if not torch.isfinite(norm + loss.detach()):
            raise FloatingPointError(
                f"team {self.team!r}: the gradient is {norm.item()}, the loss {loss.item()}; "
                "observations or rewards are not finite, or the learning rate is too high"
            )
        self.optimizer.step()
        self.critic_optimizer.step()
        # of an agent that is absent in all rows the explained variance is not a number
        measured = {name: float(out[key].detach().nanmean()) for name, key in _MEASURES.items()}
        return measured | {"gradient_norm": float(norm)}

    def state_dict(self) -> dict[str, Any]:
        """See `Algorithm`: network with its value statistics, optimiser, learning rate."""
        return {name: part.state_dict() for name, part in self._parts().items()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """See `Algorithm`."""
        for name, part in self._parts().items():
            part.load_state_dict(state[name])

    def load_learnt(self, state: dict[str, Any]) -> None:
        """See `Algorithm`: the network with its value statistics."""
        self.network.load_state_dict(state["network"])

    def _parts(self) -> dict[str, Any]:
        return {
            "network": self.network,
            "optimizer": self.optimizer,
            "critic_optimizer": self.critic_optimizer,
            "schedule": self.schedule,
            **({"imitation": self._imitation} if self._imitation.active else {}),
        }

    def init_from(self, other: Algorithm) -> None:
        """See `Algorithm`: copies actor and critic from PPO, the actor from another algorithm."""
        if isinstance(other, PPO):
            check_same_network(self.cfg.network, other.cfg.network)
            self._check_same_values(other.cfg.value_normalisation)
            copy_parameters(self.network, other.network)
        else:
            copy_actor(self, other)

    def _check_same_values(self, stored: ValueNormalisation) -> None:
        """Check that both critics have statistics of their values, or neither."""
        here, none = self.cfg.value_normalisation, ValueNormalisation.none
        if (here is none) is not (stored is none):
            raise ValueError(
                f"algo.value_normalisation={stored.value} in the stored run, "
                f"{here.value} in this one"
            )


def _split_parameters(network: TeamNetwork) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
    """Return the parameters that learn: those of the actor, and those of the critic alone."""
    actor = {id(parameter) for parameter in network.actor.parameters()}
    every = trainable(network)
    return [p for p in every if id(p) in actor], [p for p in every if id(p) not in actor]


def _batch_keys(network: TeamNetwork, team: str, masked: bool) -> list[Any]:
    """Return what is read from a batch to learn from it."""
    actor = network.actor
    return [
        *network.encoder.in_keys,
        *([STATE] if STATE in network.critic.in_keys else []),
        *actor.dist_params_keys,
        *actor.dist_sample_keys,
        *actor.log_prob_keys,
        *([(team, "mask")] if masked else []),
    ]


def _make_loss(
    team: str, network: TeamNetwork, cfg: PPOCfg, entropy: float | dict[Any, float]
) -> TeamPPOLoss:
    loss = TeamPPOLoss(
        network.actor,
        network.critic,
        clip_epsilon=cfg.clip,
        entropy_coeff=entropy,
        critic_coeff=cfg.value_coefficient,
        loss_critic_type="l2",
        functional=False,  # advantages of each agent are normalised by themselves: the default
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


def _normalise_values(
    team: str, network: TeamNetwork, kind: ValueNormalisation
) -> NormalisedCritic | None:
    """Let the critic of `network` predict normalised values, unless `kind` is ``none``."""
    if kind is ValueNormalisation.none:
        return None
    preserve = kind is ValueNormalisation.popart
    normalised = NormalisedCritic(network.critic, (team, "state_value"), preserve)
    network.critic = normalised.critic
    return normalised


def _mean(measures: list[dict[str, float]]) -> dict[str, float]:
    return {name: sum(m[name] for m in measures) / len(measures) for name in measures[0]}
