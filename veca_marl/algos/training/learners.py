"""All teams together: which of them learn, by which algorithm, and against which opponents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from veca_marl.algos.algorithm import Algorithm, AlgorithmCfg, make_algorithm
from veca_marl.algos.intrinsic.bonus import Bonus
from veca_marl.algos.intrinsic.intrinsic_reward import NONE, IntrinsicCfg
from veca_marl.algos.policy import Policy
from veca_marl.algos.specs import TeamSpec
from veca_marl.algos.storage import StorageNeeded


class TeamLearners:
    """The algorithms of all teams that learn, on the same batches.

    Args:
        specs: Team name to its arrays.
        cfg: The numbers of the algorithm of every team.
        device: Where networks are and learn.
        own: Numbers of teams with other ones.
        frozen: Policies of teams that do not learn.
        intrinsic: Team to its intrinsic reward; ``none`` for a team that is not in it.

    Attributes:
        algorithms: Team to its algorithm, without frozen teams.
        frozen: Team to its policy.
        learning: Teams that learn from the next batches, a subset of `algorithms`.
        bonuses: Team to its intrinsic rewards, for teams that have any.
        policy: Acts for all teams; changes with every gradient step.
    """

    def __init__(
        self,
        specs: Mapping[str, TeamSpec],
        cfg: AlgorithmCfg,
        device: torch.device,
        own: Mapping[str, AlgorithmCfg] | None = None,
        frozen: Mapping[str, TensorDictModuleBase] | None = None,
        intrinsic: Mapping[str, IntrinsicCfg] | None = None,
    ) -> None:
        self.device, self.specs = device, dict(specs)
        own, frozen = own or {}, frozen or {}
        self.frozen = {team: actor.to(device) for team, actor in frozen.items()}
        self.cfgs = {team: own.get(team, cfg) for team in specs if team not in frozen}
        self.algorithms: dict[str, Algorithm] = {
            team: make_algorithm(team, specs[team], numbers, device)
            for team, numbers in self.cfgs.items()
        }
        self.learning = list(self.algorithms)
        self.bonuses = {  # made last, so that algorithms start alike with and without
            team: Bonus(team, specs[team], numbers, device)
            for team, numbers in (intrinsic or {}).items()
            if team in self.algorithms and numbers.name != NONE
        }
        self.policy = self._make_policy()

    def _make_policy(self) -> Policy:
        actors, explorers = {}, {}
        for team in self.specs:
            if team in self.frozen:
                actors[team] = explorers[team] = self.frozen[team]
            else:
                algorithm = self.algorithms[team]
                actors[team], explorers[team] = algorithm.actor, algorithm.explorer
        return Policy(actors, explorers)

    @property
    def need_experience(self) -> bool:
        """Whether any algorithm learns from what the policies do."""
        return any(algorithm.needs_experience for algorithm in self.algorithms.values())

    @property
    def exact_resume(self) -> bool:
        """Whether a resumed run continues bit for bit: only if every algorithm does."""
        return all(algorithm.exact_resume for algorithm in self.algorithms.values())

    @property
    def storage_needed(self) -> dict[str, StorageNeeded]:
        """Team to what its algorithm stores beside its parameters."""
        return {team: each.storage_needed for team, each in self.algorithms.items()}

    def learn(self, batch: TensorDictBase) -> dict[str, dict[str, float]]:
        """Learn from one batch ``(worlds, steps)``; return the measures of each team.

        Teams that do not learn at present have measures that are not a number. The rewards in
        `batch` stay those of the task; see `Bonus.add`.
        """
        return {team: self._learn(team, batch) for team in self.algorithms}

    def _learn(self, team: str, batch: TensorDictBase) -> dict[str, float]:
        algorithm, bonus = self.algorithms[team], self.bonuses.get(team)
        if team not in self.learning:
            return algorithm.idle() | ({} if bonus is None else bonus.idle(batch))
        if bonus is None:
            return algorithm.learn(batch)
        mixed, measured = bonus.add(batch)
        return algorithm.learn(mixed) | measured

    def actor_states(self) -> dict[str, dict[str, Any]]:
        """Return what a file for playing contains, by team."""
        return {team: algorithm.actor.state_dict() for team, algorithm in self.algorithms.items()}

    def state_dict(self) -> dict[str, Any]:
        """Return the state of every algorithm by team."""
        return {team: algorithm.state_dict() for team, algorithm in self.algorithms.items()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`."""
        for team, algorithm in self.algorithms.items():
            algorithm.load_state_dict(state[team])

    def intrinsic_state(self) -> dict[str, Any]:
        """Return the state of the intrinsic rewards by team."""
        return {team: bonus.state_dict() for team, bonus in self.bonuses.items()}

    def load_intrinsic_state(self, state: dict[str, Any]) -> None:
        """Continue from `intrinsic_state`."""
        for team, bonus in self.bonuses.items():
            bonus.load_state_dict(state[team])


class Matchmaking(Protocol):
    """Chooses for each stage the teams that learn and their opponents."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """Choose; the choice depends on the arguments and the seed alone.

        Args:
            stage: Number of finished stages.
            frames: Frames learnt from so far.
        """
        ...

    def learns(self, team: str, stage: int) -> bool:
        """Return whether a team that is not frozen learns in a stage."""
        ...

    def load_opponent(self, policy: Policy) -> None:
        """Load the parameters of the opponent into the copy of the policy that collects."""
        ...

    def end_stage(self, frames: int) -> None:
        """Store what was learnt as a possible opponent of later stages."""
        ...

    def measures(self) -> dict[str, float]:
        """Return numbers for the logs that describe this stage's match."""
        ...


class AllLearn:
    """Every team learns in every stage, against the current policies of the others."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """See `Matchmaking`."""

    def learns(self, team: str, stage: int) -> bool:
        """See `Matchmaking`."""
        return True

    def load_opponent(self, policy: Policy) -> None:
        """See `Matchmaking`."""

    def end_stage(self, frames: int) -> None:
        """See `Matchmaking`."""

    def measures(self) -> dict[str, float]:
        """See `Matchmaking`."""
        return {}
