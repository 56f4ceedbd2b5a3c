"""Proximal policy optimisation of several teams: a learner for each, over the same batches."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential

from veca_marl.algos.ppo.learner import PPOCfg, TeamLearner
from veca_marl.algos.specs import TeamSpec


class PPO:
    """One learner per team over the same batches.

    Args:
        specs: Team name to its arrays.
        cfg: The numbers.
        device: Where networks live and learn.
        own: The numbers of teams that have others.
        frozen: Policies of teams that do not learn.

    Attributes:
        policy: Writes the actions of all teams; changes with every gradient step.
        actors: The parts of `policy` by team.
        learning: The teams that learn from the next batches; the others keep what they know.
    """

    def __init__(
        self,
        specs: Mapping[str, TeamSpec],
        cfg: PPOCfg,
        device: torch.device,
        own: Mapping[str, PPOCfg] | None = None,
        frozen: Mapping[str, TensorDictModuleBase] | None = None,
    ) -> None:
        self.device = device
        own, frozen = own or {}, frozen or {}
        self.learners = {
            team: TeamLearner(team, spec, own.get(team, cfg), device)
            for team, spec in specs.items()
            if team not in frozen
        }
        self.learning = list(self.learners)
        self.actors = {
            team: frozen[team].to(device) if team in frozen else self.learners[team].network.actor
            for team in specs
        }
        self.policy = TensorDictSequential(*self.actors.values())

    def copy_policy(self) -> TensorDictSequential:
        """Return a copy of the policy that plays on the CPU and does not change by itself."""
        return deepcopy(self.policy).to("cpu")

    @torch.no_grad()
    def refresh(self, player: TensorDictSequential) -> None:
        """Give a copy of the policy the parameters of now."""
        for old, new in zip(player.parameters(), self.policy.parameters(), strict=True):
            old.copy_(new)

    def prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """Turn a batch ``(worlds, steps)`` as collected into rows to learn from, on the device."""
        rows = TensorDict({}, batch.batch_size)
        for team in self.learning:
            rows.update(self.learners[team].prepare(batch))
        return rows.reshape(-1).to(self.device)

    def learn(self, rows: TensorDictBase) -> dict[str, dict[str, float]]:
        """Make all epochs over `rows`; return the mean of each measure by team, if it learns."""
        return {
            team: learner.learn(rows.select(team)) if team in self.learning else learner.pause()
            for team, learner in self.learners.items()
        }

    def begin_with(self, team: str, network: Mapping[str, Any]) -> None:
        """Let a team begin with what another run has learnt; its optimiser begins anew."""
        self.learners[team].network.load_state_dict(network)

    def state_dict(self) -> dict[str, Any]:
        """Return the state of every learner by team."""
        return {team: learner.state_dict() for team, learner in self.learners.items()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continue from `state_dict`."""
        for team, learner in self.learners.items():
            learner.load_state_dict(state[team])
