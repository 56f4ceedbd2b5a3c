"""Evaluation of a policy: whole episodes in separate worlds, from seeds of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import nn
from torchrl.data import Composite
from torchrl.envs import EnvBase, ExplorationType, set_exploration_type
from torchrl.envs.utils import RandomPolicy

from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.training.episodes import EpisodeTally

ActionPolicy = Callable[[TensorDictBase], TensorDictBase]


class Exploration(Enum):
    """Whether an evaluated policy takes the mode of its distribution or a sample."""

    deterministic = "deterministic"
    stochastic = "stochastic"


_TYPES = {
    Exploration.deterministic: ExplorationType.DETERMINISTIC,
    Exploration.stochastic: ExplorationType.RANDOM,
}


@dataclass
class EvalCfg:
    """When and how policies are evaluated; each evaluation is followed by a checkpoint.

    Attributes:
        every_frames: Training frames between two evaluations (rounded up to whole batches). The
            training worlds start new episodes after each, so that a run resumed from the
            checkpoint continues exactly.
        episodes: Episodes of an evaluation; each evaluation has the same starts.
        worlds: Worlds that play them at the same time.
        exploration: ``deterministic`` takes the most likely actions, ``stochastic`` samples as
            collection does.
    """

    every_frames: int = 20480
    episodes: int = 8
    worlds: int = 4
    exploration: Exploration = Exploration.deterministic

    def __post_init__(self) -> None:
        for name in ("every_frames", "episodes", "worlds"):
            if getattr(self, name) < 1:
                raise ValueError(f"eval.{name} must be at least 1, got {getattr(self, name)}")


@dataclass(frozen=True)
class Scores:
    """Results of one team in some episodes; each array is ``(episodes,)``.

    Attributes:
        returns: Undiscounted sum of rewards, mean over the team's agents.
        lengths: Number of steps.
        terms: The same sum for each unweighted term of the reward.
    """

    returns: NDArray[np.float64]
    lengths: NDArray[np.float64]
    terms: dict[str, NDArray[np.float64]]


def evaluate(
    env: EnvBase, policy: ActionPolicy, episodes: int, seed: int, exploration: Exploration
) -> dict[str, Scores]:
    """Play whole episodes and return each team's scores, in an order that depends on `env` alone.

    Every world plays equally many, so that short episodes are not preferred; `episodes` is
    rounded up to a multiple of the worlds. The result depends on the arguments alone. Worlds are
    seeded anew: episode k of world w starts alike for every policy.
    """
    torch.manual_seed(seed)
    env.set_seed(seed)
    worlds = env.batch_size[0]
    tally = EpisodeTally(list(env.group_map), worlds, quota=-(-episodes // worlds))
    playing = with_memory(env, policy)
    with torch.no_grad(), set_exploration_type(_TYPES[exploration]):
        state = playing.reset()
        while not tally.complete:
            played, state = playing.step_and_maybe_reset(policy(state))
            tally.add(played["next"])
    return {team: _scores(tally.sums(team)) for team in env.group_map}


def _scores(sums: dict[str, NDArray[np.float64]]) -> Scores:
    return Scores(sums.pop("return"), sums.pop("length"), sums)


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
