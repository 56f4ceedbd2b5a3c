"""How well a policy plays: episodes in worlds of their own, from seeds of their own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import stats
from tensordict import TensorDictBase
from torchrl.envs import EnvBase, ExplorationType, set_exploration_type
from torchrl.envs.utils import RandomPolicy

Policy = Callable[[TensorDictBase], TensorDictBase]


class Exploration(Enum):
    """Whether an evaluated policy takes its most likely action or draws one."""

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
        episodes: Episodes of an evaluation, the same starts each time.
        worlds: Worlds that play them at once.
        exploration: ``deterministic`` measures what was learnt, ``stochastic`` what acts while
            learning.
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
    """What one team did in some episodes; each array is ``(episodes,)``.

    Attributes:
        returns: Undiscounted sum of rewards, mean over the team's agents.
        lengths: Steps.
        terms: The same sum for each unweighted term of the reward.
    """

    returns: NDArray[np.float64]
    lengths: NDArray[np.float64]
    terms: dict[str, NDArray[np.float64]]


def evaluate(
    env: EnvBase, policy: Policy, episodes: int, seed: int, exploration: Exploration
) -> dict[str, Scores]:
    """Play whole episodes and return each team's scores.

    Every world plays equally many, so that short episodes are not preferred; `episodes` is
    rounded up to a multiple of the worlds. The result depends on the arguments alone.
    """
    torch.manual_seed(seed)
    env.set_seed(seed)
    worlds = env.batch_size[0]
    tally = _Tally(list(env.group_map), worlds, quota=-(-episodes // worlds))
    with torch.no_grad(), set_exploration_type(_TYPES[exploration]):
        state = env.reset()
        while not tally.complete:
            played, state = env.step_and_maybe_reset(policy(state))
            tally.add(played["next"])
    return tally.scores()


def random_policy(env: EnvBase) -> Policy:
    """Return the policy that draws every action uniformly."""
    return RandomPolicy(env.full_action_spec)


def interval(values: NDArray[np.float64], confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval of the mean by Student's t; a single value has no known width."""
    if len(values) < 2:
        return math.nan, math.nan
    half = stats.t.ppf((1 + confidence) / 2, len(values) - 1) * math.sqrt(_error(values))
    return float(values.mean() - half), float(values.mean() + half)


def difference(
    one: NDArray[np.float64], other: NDArray[np.float64], confidence: float = 0.95
) -> tuple[float, float, float]:
    """Return the difference of the means and its interval.

    Source: Welch 1947, "The generalization of Student's problem when several different
    population variances are involved": the variances need not be equal.
    """
    mean = float(one.mean() - other.mean())
    if min(len(one), len(other)) < 2:
        return mean, math.nan, math.nan
    errors = np.array([_error(one), _error(other)])
    if not errors.any():
        return mean, mean, mean
    freedom = errors.sum() ** 2 / (errors**2 / [len(one) - 1, len(other) - 1]).sum()
    half = float(stats.t.ppf((1 + confidence) / 2, freedom) * math.sqrt(errors.sum()))
    return mean, mean - half, mean + half


def _error(values: NDArray[np.float64]) -> float:
    """Return the squared standard error of the mean."""
    return float(values.var(ddof=1) / len(values))


def comparison_line(team: str, policy: Scores, baseline: Scores) -> str:
    """Say in one line how a policy compares with the random one."""
    parts = [
        f"{name} {scores.returns.mean():.3f} [{low:.3f}, {high:.3f}]"
        for name, scores in (("policy", policy), ("random", baseline))
        for low, high in [interval(scores.returns)]
    ]
    mean, low, high = difference(policy.returns, baseline.returns)
    episodes = f"{len(policy.returns)} and {len(baseline.returns)} episodes"
    return (
        f"{team}: return of {parts[0]}, {parts[1]}, difference {mean:.3f} "
        f"[{low:.3f}, {high:.3f}] (means of {episodes}, 95 % intervals)"
    )


class _Tally:
    """Adds up rewards of worlds until each has finished `quota` episodes."""

    def __init__(self, teams: list[str], worlds: int, quota: int) -> None:
        self.teams, self.quota = teams, quota
        self.open: dict[tuple[str, str], NDArray[np.float64]] = {}
        self.finished: dict[tuple[str, str], list[list[float]]] = {}
        self.episodes = np.zeros(worlds, dtype=np.int64)

    @property
    def complete(self) -> bool:
        return bool((self.episodes >= self.quota).all())

    def add(self, step: TensorDictBase) -> None:
        ended = np.flatnonzero(step["done"].squeeze(-1).numpy())
        for team in self.teams:
            for name, values in team_measures(step, team).items():
                key = (team, name)
                sums = self.open.setdefault(key, np.zeros(len(self.episodes)))
                sums += values
                lists = self.finished.setdefault(key, [[] for _ in self.episodes])
                for world in ended:
                    lists[world].append(float(sums[world]))
                sums[ended] = 0.0
        self.episodes[ended] += 1

    def scores(self) -> dict[str, Scores]:
        def array(team: str, name: str) -> NDArray[np.float64]:
            return np.array([v[: self.quota] for v in self.finished[team, name]]).ravel()

        return {
            team: Scores(
                returns=array(team, "return"),
                lengths=array(team, "length"),
                terms={
                    name: array(team, name)
                    for who, name in self.finished
                    if who == team and name not in ("return", "length")
                },
            )
            for team in self.teams
        }


def team_measures(step: TensorDictBase, team: str) -> dict[str, NDArray[np.float64]]:
    """Return what is summed over an episode: reward, terms, one per step; mean over agents.

    Args:
        step: The ``next`` part of some frames.
        team: Whose.

    Returns:
        ``return``, ``length`` and each term: arrays of the batch shape of `step`.
    """
    reward = step[team, "reward"].squeeze(-1).mean(-1).double().cpu().numpy()
    measures = {"return": reward, "length": np.ones_like(reward)}
    terms = step[team].get("terms", None)
    for name, term in sorted(terms.items()) if terms is not None else ():
        measures[name] = term.squeeze(-1).mean(-1).double().cpu().numpy()
    return measures
