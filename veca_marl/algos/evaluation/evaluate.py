"""Evaluation of a policy: whole episodes in separate worlds, from seeds of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import nn
from torchrl.data import Composite
from torchrl.envs import EnvBase, ExplorationType, set_exploration_type
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.evaluation.episodes import EACH, SOLVED, EpisodeTally
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.seeds import derived_seed, seed_worlds

ActionPolicy = Callable[[TensorDictBase], TensorDictBase]


class Exploration(Enum):
    """Whether an evaluated policy takes the mode of its distribution or a sample."""

    deterministic = "deterministic"
    stochastic = "stochastic"


EXPLORATION_TYPES = {
    Exploration.deterministic: ExplorationType.DETERMINISTIC,
    Exploration.stochastic: ExplorationType.RANDOM,
}
"""TorchRL's name of each."""


@dataclass
class EvalCfg:
    """When and how policies are evaluated; each evaluation is followed by a checkpoint.

    Attributes:
        every_frames: Training frames between two evaluations (rounded up to whole batches). The
            training worlds start new episodes after each, so that a run resumed from the
            checkpoint continues exactly. After a quarter of the first of these stages there is a
            checkpoint too, if an episode fits into the rest.
        episodes: Episodes of an evaluation; each evaluation has the same starts.
        final_episodes: Episodes of the last evaluation of a run and of the random policy it is
            compared with, the same as those of other evaluations and more; None is twice
            `episodes`.
        worlds: Worlds that play them at the same time, in all worker processes together.
        exploration: ``deterministic`` takes the most likely actions, ``stochastic`` samples as
            collection does.
    """

    every_frames: int = 40_960
    episodes: int = 8
    final_episodes: int | None = None
    worlds: int = 8
    exploration: Exploration = Exploration.deterministic

    def __post_init__(self) -> None:
        for name in ("every_frames", "episodes", "worlds"):
            if getattr(self, name) < 1:
                raise ValueError(f"eval.{name} must be at least 1, got {getattr(self, name)}")
        if self.final_episodes is not None and self.final_episodes < self.episodes:
            raise ValueError(
                f"eval.final_episodes must be at least eval.episodes={self.episodes}, "
                f"got {self.final_episodes}"
            )

    @property
    def last_episodes(self) -> int:
        """Episodes of the last evaluation."""
        return 2 * self.episodes if self.final_episodes is None else self.final_episodes


@dataclass(frozen=True)
class Scores:
    """Results of one team in some episodes; each array is ``(episodes,)``.

    Attributes:
        returns: Undiscounted sum of rewards, mean over the team's agents.
        lengths: Number of steps.
        terms: The same sum for each unweighted term of the reward.
        solved: Share of the team's agents for which the goal was reached at the end of the episode,
            in [0, 1]; None if the task has no goal.
        each: The return of each agent, by ``return/0``, ``return/1``, ...; empty for a team of one.
    """

    returns: NDArray[np.float64]
    lengths: NDArray[np.float64]
    terms: dict[str, NDArray[np.float64]]
    solved: NDArray[np.float64] | None = None
    each: dict[str, NDArray[np.float64]] = field(default_factory=dict)


def evaluate(
    env: EnvBase,
    policy: ActionPolicy,
    episodes: int,
    seed: int,
    exploration: Exploration,
    first: int = 0,
    played: Callable[[int], object] = lambda count: None,
) -> dict[str, Scores]:
    """Play whole episodes and return each team's scores, in the order of their numbers.

    The start of an episode depends on `seed` and its number alone, for every policy and for any
    number of worlds (where the environment has a `first_world`, as `VecaEnv`; with other
    environments it depends on the number of worlds too). Samples of a policy are drawn for all
    worlds at once: they depend on the number of worlds.

    Args:
        env: The environment. Its worlds play as many episodes at the same time.
        policy: Writes the actions of all teams.
        episodes: Number of episodes.
        seed: Seed of the starts and of the samples.
        exploration: Whether actions are sampled.
        first: Number of the first episode.
        played: Called with the number of episodes that have ended since its last call.
    """
    worlds = env.batch_size[0]
    tallies = []
    with torch.no_grad(), set_exploration_type(EXPLORATION_TYPES[exploration]):
        for number in range(first, first + episodes, worlds):
            seed_episodes(env, seed, number)
            count = min(worlds, first + episodes - number)
            tallies.append(_play_one_each(env, policy, count))
            played(count)
    return {team: _joined([tally.sums(team) for tally in tallies]) for team in env.group_map}


def seed_episodes(env: EnvBase, seed: int, first: int) -> None:
    """Let the next reset of world w begin episode `first` + w, and seed the samples."""
    seed_worlds(env, seed, first)
    torch.manual_seed(derived_seed(seed, first))


def _play_one_each(env: EnvBase, policy: ActionPolicy, count: int) -> EpisodeTally:
    """Play an episode in each of the first `count` worlds."""
    playing = with_memory(env, policy)
    tally = EpisodeTally(list(env.group_map), env.batch_size[0], count)
    state = playing.reset()
    while not tally.complete:
        played, state = playing.step_and_maybe_reset(policy(state))
        tally.add(played["next"])
    return tally


def _joined(parts: Sequence[dict[str, NDArray[np.float64]]]) -> Scores:
    sums = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    returns, lengths, solved = sums.pop("return"), sums.pop("length"), sums.pop(SOLVED, None)
    each = {name: sums.pop(name) for name in list(sums) if name.startswith(EACH)}
    return Scores(returns, lengths, sums, solved, each)


def joined_scores(parts: Sequence[Mapping[str, Scores]]) -> dict[str, Scores]:
    """Return the scores of all episodes of several evaluations, one after the other."""
    return {
        team: Scores(
            np.concatenate([part[team].returns for part in parts]),
            np.concatenate([part[team].lengths for part in parts]),
            _joined_terms([part[team].terms for part in parts]),
            _joined_solved([part[team].solved for part in parts]),
            _joined_terms([part[team].each for part in parts]),
        )
        for team in parts[0]
    }


def _joined_terms(parts: Sequence[dict[str, NDArray[np.float64]]]) -> dict[str, NDArray[Any]]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _joined_solved(parts: Sequence[NDArray[np.float64] | None]) -> NDArray[np.float64] | None:
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays) if arrays else None


class RandomTeams(nn.Module):
    """Uniformly random actions for some teams; the others keep their policies.

    Args:
        env: The environment with the specs of the actions.
        teams: Teams that act at random.
        others: Policies of the other teams.
    """

    def __init__(
        self, env: EnvBase, teams: Sequence[str], others: Sequence[nn.Module] = ()
    ) -> None:
        super().__init__()
        spec = env.full_action_spec
        self._random = RandomPolicy(
            Composite({team: spec[team] for team in teams}, shape=env.batch_size)
        )
        self.others = nn.ModuleList(others)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of all teams."""
        acted: TensorDictBase = self._random(tensordict)
        for actor in self.others:
            acted = actor(acted)
        return acted


def random_policy(env: EnvBase) -> RandomTeams:
    """Return the policy that draws every action uniformly."""
    return RandomTeams(env, list(env.group_map))
