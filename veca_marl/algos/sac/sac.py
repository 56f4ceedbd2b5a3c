"""Soft actor-critic of one team: replay buffer, updates, state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch import nn
from torch.distributions import Distribution

from veca_marl.algos.algorithm import Algorithm
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.imitation.term import ImitationTerm
from veca_marl.algos.networks.action_values import make_actor_critics
from veca_marl.algos.networks.factory import (
    NetworkCfg,
    check_same_network,
    check_same_settings,
    copy_actor,
    trainable,
)
from veca_marl.algos.networks.layers import clip_norms, independent_parameters
from veca_marl.algos.networks.memory import initial_states, memory_size
from veca_marl.algos.policy import UniformWarmUp
from veca_marl.algos.sac.config import EncoderGradient, SACCfg, Targets
from veca_marl.algos.sac.joint_action import JointAction
from veca_marl.algos.sac.loss import TeamCrossQLoss, TeamSACLoss, Temperatures
from veca_marl.algos.sac.readers import RandomShift, make_reader, memory_keys
from veca_marl.algos.sac.replay import (
    END,
    Replay,
    Span,
    StoredKeys,
    storage_needed,
    transitions,
)
from veca_marl.algos.sense_encoders import copy_parameters
from veca_marl.algos.specs import PLAIN, TeamSpec
from veca_marl.algos.storage import StorageNeeded


class SAC(Algorithm):
    """Network, replay buffer, losses and optimiser of one team.

    Actions are samples of the policy; uniformly random ones before the first update.

    Args:
        team: Name of the team: the first part of all its keys.
        spec: Its arrays.
        cfg: The numbers.
        device: Where it learns.

    Attributes:
        exact_resume: Whether checkpoints contain the replay buffer, see `ReplayCfg`.
    """

    def __init__(self, team: str, spec: TeamSpec, cfg: SACCfg, device: torch.device) -> None:
        self.team, self.cfg, self._spec, self._device = team, cfg, spec, device
        self.exact_resume = cfg.replay.in_checkpoint
        self.network = make_actor_critics(
            team, spec, cfg.network, cfg.critic, self.policy_hidden
        ).to(device)
        memory = memory_keys(self.network.encoder, team)
        span = _span(cfg, recurrent=bool(memory))
        self.temperatures = Temperatures(spec.actions, cfg.temperature).to(device)
        self.loss = _LOSSES[cfg.targets](
            team,
            self.network,
            JointAction(team, spec.actions),
            self.temperatures,
            cfg.encoder_gradient,
            make_reader(team, memory, span),
        ).to(device)
        critics = [*trainable(self.network.encoder), *self.network.values.parameters()]
        self._critics = independent_parameters([self.network.encoder, self.network.values])
        self._policy = independent_parameters([self.loss.policy])
        groups: list[dict[str, Any]] = [
            {"params": [*critics, *self.loss.policy.parameters()]},
            {"params": list(self.temperatures.parameters()), "lr": cfg.temperature.learning_rate},
        ]
        self.optimizer = torch.optim.Adam(groups, cfg.learning_rate, fused=True)
        self.replay = Replay(StoredKeys.of(team, spec, memory), cfg.replay, span)
        self._windows = cfg.batch_size // span.length
        self._shift = RandomShift(team, spec, cfg.random_shift)
        self._warm_up = UniformWarmUp(team, spec).to(device)
        self._explorer = TensorDictSequential(self.network.actor, self._warm_up)
        self._updates, self._due = 0, 0.0
        self._imitation = ImitationTerm(
            team, spec, self.network.actor, cfg.imitation, cfg.sequence_steps, self._policy_of
        )
        self._keys = StoredKeys.of(team, spec, memory)
        self._demonstrations: Demonstrations | None = None

    @property
    def network_cfg(self) -> NetworkCfg:
        """See `Algorithm`."""
        return self.cfg.network

    @property
    def policy_hidden(self) -> list[int]:
        """See `Algorithm`."""
        return list(self.cfg.policy_hidden)

    @property
    def actor(self) -> TensorDictModuleBase:
        """See `Algorithm`."""
        return self.network.actor

    @property
    def explorer(self) -> TensorDictModuleBase:
        """See `Algorithm`."""
        return self._explorer

    @property
    def measures(self) -> list[str]:
        """See `Algorithm`."""
        alphas = (_name(part) for part in self.temperatures.targets)
        return [*_MEASURES, *alphas, *_COUNTS, *self._imitation.measures]

    @property
    def storage_needed(self) -> StorageNeeded:
        """See `Algorithm`: the replay buffer."""
        return storage_needed(self._spec, self.cfg.replay, memory_size(self.network.encoder))

    def take_demonstrations(self, demonstrations: Demonstrations) -> None:
        """See `Algorithm`: they fill a part of the replay buffer, and are imitated.

        No uniformly random actions follow.
        """
        self._demonstrations = demonstrations
        self._imitation.take(demonstrations)
        self._warm_up.active.fill_(False)
        self._seed_replay()

    def _seed_replay(self) -> None:
        """Fill a part of an empty replay buffer with whole demonstrated episodes."""
        if self._demonstrations is None or len(self.replay):
            return
        room, rows = int(self.cfg.demonstrated * self.cfg.replay.capacity), 0
        for episode in self._demonstrations.episodes:
            if rows + episode.steps + 1 > room:
                break
            rows += episode.steps + 1
        if rows == 0:
            return
        keys = (*self._keys.observation, *self._keys.mask, *self._keys.action)
        outcome = [(self.team, "reward"), (self.team, "terminated"), (END,)]
        found = self._demonstrations.rows[:rows].select(*keys, *outcome).clone()
        for key, state in initial_states(self.network.actor, (rows,)).items():
            found[key] = state
        self.replay.seed(found)

    def _policy_of(self, rows: TensorDictBase) -> Distribution:
        """Return the distribution of the policy in demonstrated rows."""
        encoder = self.network.encoder
        features = encoder(rows.select(*encoder.in_keys))[self.team, "features"]
        if self.cfg.encoder_gradient is EncoderGradient.critic:
            features = features.detach()
        state = TensorDict({}, rows.batch_size)
        state[self.team, "features"] = features
        found: Distribution = self.loss.policy.get_dist(state)
        return found

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """See `Algorithm`: store the batch and make the updates that are due."""
        self.replay.extend(batch)
        measured = [self.update() for _ in range(self._take_due(batch.numel()))]
        self._updates += len(measured)
        if self.replay.ready:
            # never switched on again: a run that continues, or starts from another one, fills an
            # empty buffer with its policy
            self._warm_up.active.fill_(False)
        self._imitation.frames += batch.numel()
        return _mean(measured) | self._alphas() | self._counts() | self._imitation.measures

    def _take_due(self, frames: int) -> int:
        """Return the number of updates for a batch of so many frames."""
        if not self.replay.ready:
            return 0
        self._due += frames * self.cfg.updates_per_frame
        whole = math.floor(self._due)
        self._due -= whole
        return whole

    def update(self) -> dict[str, float]:
        """Take one gradient step on a sample of the replay buffer and return what was measured.

        A sample without any agent that is present changes nothing; its measures are not a number.

        Raises:
            FloatingPointError: If the gradient is not finite.
        """
        windows = self.replay.sample(self._windows)
        self._shift(*windows.observed)
        batch = transitions(windows, self.team, self.cfg.gamma)
        if not batch.counted.any():
            return dict.fromkeys(_MEASURES, math.nan)
        losses = self.loss(batch.to(self._device))
        self.optimizer.zero_grad()
        loss = losses.critic + losses.policy + losses.temperature
        if self._imitation.active:
            loss = loss + self._imitation.loss(self._device)
        loss.backward()
        norms = [self._clip(self._critics), self._clip(self._policy)]
        self.optimizer.step()
        self.temperatures.project()
        self._move_target(self.cfg.tau)
        numbers = losses.measures | {"critic_loss": losses.critic, "policy_loss": losses.policy}
        measured = {name: float(number.detach()) for name, number in numbers.items()}
        return measured | {"critic_gradient_norm": norms[0], "policy_gradient_norm": norms[1]}

    def _clip(self, groups: list[list[nn.Parameter]]) -> float:
        norm = float(clip_norms(groups, self.cfg.max_gradient_norm))
        if not math.isfinite(norm):
            raise FloatingPointError(
                f"team {self.team!r}: the gradient is {norm}; observations or rewards are not "
                "finite, or the learning rate is too high"
            )
        return norm

    def _alphas(self) -> dict[str, float]:
        return {_name(part): float(a) for part, a in self.temperatures.alphas().items()}

    def _counts(self) -> dict[str, float]:
        return {
            "updates": float(self._updates),
            "updates_per_frame": self._updates / self.replay.frames,
            "replay_rows": float(len(self.replay)),
        }

    def state_dict(self) -> dict[str, Any]:
        """See `Algorithm`: network, targets, temperatures, optimiser and counts."""
        parts = {name: part.state_dict() for name, part in self._parts().items()}
        return parts | {"updates": self._updates, "due": self._due}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """See `Algorithm`."""
        for name, part in self._parts().items():
            part.load_state_dict(state[name])
        self._updates, self._due = state["updates"], state["due"]
        self._seed_replay()

    def load_learnt(self, state: dict[str, Any]) -> None:
        """See `Algorithm`: the network alone."""
        self.network.load_state_dict(state["network"])

    def _parts(self) -> dict[str, Any]:
        target = {"target": self.loss.target} if self.loss.averages else {}
        imitation = {"imitation": self._imitation} if self._imitation.active else {}
        return (
            target
            | imitation
            | {
                "network": self.network,
                "temperatures": self.temperatures,
                "warm_up": self._warm_up,
                "optimizer": self.optimizer,
                "replay": self.replay,
            }
        )

    def init_from(self, other: Algorithm) -> None:
        """See `Algorithm`: copies actor and critics from SAC, the actor from another algorithm."""
        if isinstance(other, SAC):
            check_same_network(self.cfg.network, other.cfg.network)
            check_same_settings("network", _sizes(self.cfg), _sizes(other.cfg))
            copy_parameters(self.network, other.network)
        else:
            copy_actor(self, other)
        self._move_target(1.0)
        self._warm_up.active.fill_(False)

    def init_encoders(self, encoders: Mapping[str, Sequence[nn.Module]]) -> None:
        """See `Algorithm`: actor and critics share the encoders."""
        super().init_encoders(encoders)
        self._move_target(1.0)

    def _move_target(self, share: float) -> None:
        """Move the target networks by `share` of the way to the critics; 1 makes them equal."""
        if self.loss.averages:
            self.loss.target.approach(self.loss.critic, share)


_LOSSES = {Targets.average: TeamSACLoss, Targets.same: TeamCrossQLoss}
_MEASURES = (
    "critic_loss",
    "policy_loss",
    "value",
    "entropy",
    "critic_gradient_norm",
    "policy_gradient_norm",
)
_COUNTS = ("updates", "updates_per_frame", "replay_rows")


def _span(cfg: SACCfg, recurrent: bool) -> Span:
    """Return the rows of a window: single steps for networks without hidden state."""
    if not recurrent:
        return Span(0, 1, cfg.steps)
    return Span(cfg.burn_in, cfg.sequence_steps, cfg.steps)


def _name(part: str) -> str:
    """Return the name in the logs of the temperature of a part of the action."""
    return "alpha" if part == PLAIN else f"alpha_{part}"


def _mean(measures: list[dict[str, float]]) -> dict[str, float]:
    """Return the mean of each measure that is a number; not a number if there are none."""
    return {name: _mean_of([m[name] for m in measures]) for name in _MEASURES}


def _mean_of(numbers: list[float]) -> float:
    known = [number for number in numbers if not math.isnan(number)]
    return sum(known) / len(known) if known else math.nan


def _sizes(cfg: SACCfg) -> dict[str, Any]:
    """Return the settings on which the layers depend beside those of `NetworkCfg`, by name."""
    critic = {f"algo.critic.{name}": value for name, value in vars(cfg.critic).items()}
    return {"algo.policy_hidden": list(cfg.policy_hidden), **critic}
