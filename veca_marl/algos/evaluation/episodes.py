"""Sums over whole episodes: of what a policy is evaluated by, and of what is collected."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase

SOLVED = "solved"
"""Entry of ``(team, "info")`` that is read at the end of an episode; the others are summed."""

EACH = "return/"
"""What the name of the return of one agent begins with; the index of the agent follows."""


def team_measures(step: TensorDictBase, team: str) -> dict[str, NDArray[np.float64]]:
    """Return what is summed over an episode, and `SOLVED`, as means over the team's agents.

    Args:
        step: The ``next`` part of some frames.
        team: Name of the team.

    Returns:
        ``return`` (the reward), ``length`` (one for each step), each entry of
        ``(team, "info")`` (the unweighted reward terms; ``solved`` in a task with a goal), and in a
        team of several agents ``return/0``, ``return/1``, ...: the reward of each of them. They
        are arrays of the batch shape of `step`.
    """
    reward = _agent_mean(step[team, "reward"])
    measures = {"return": reward, "length": np.ones_like(reward), **_of_each(step, team)}
    info = step[team].get("info", None)
    for name, term in sorted(info.items()) if info is not None else ():
        measures[name] = _agent_mean(term)
    return measures


def _of_each(step: TensorDictBase, team: str) -> dict[str, NDArray[np.float64]]:
    """Return the reward of each agent, if there are several."""
    rewards = step[team, "reward"].squeeze(-1).double().cpu().numpy()
    agents = rewards.shape[-1]
    return {f"{EACH}{i}": rewards[..., i] for i in range(agents)} if agents > 1 else {}


def _agent_mean(array: object) -> NDArray[np.float64]:
    mean: NDArray[np.float64] = array.squeeze(-1).double().mean(-1).cpu().numpy()  # type: ignore[attr-defined]
    return mean


class EpisodeTally:
    """Sums of `team_measures` over the first episode of each of the first worlds.

    The entry `SOLVED` is not summed: its last value counts.

    Args:
        teams: Names of the teams.
        worlds: Number of worlds.
        count: Number of worlds that count.
    """

    def __init__(self, teams: list[str], worlds: int, count: int) -> None:
        self.teams, self.count = teams, count
        self._sums: dict[tuple[str, str], NDArray[np.float64]] = {}
        self._open = np.ones(worlds, dtype=np.bool_)

    @property
    def complete(self) -> bool:
        """Whether the episode of every world that counts has ended."""
        return not self._open[: self.count].any()

    def add(self, step: TensorDictBase) -> None:
        """Add one step ``(worlds,)``, the ``next`` part of a frame."""
        for team in self.teams:
            for name, values in team_measures(step, team).items():
                sums = self._sums.setdefault((team, name), np.zeros(len(values)))
                earlier = 0.0 if name == SOLVED else sums[self._open]
                sums[self._open] = earlier + values[self._open]
        self._open &= ~step["done"].squeeze(-1).numpy()

    def sums(self, team: str) -> dict[str, NDArray[np.float64]]:
        """Return for each measure the sums ``(count,)``."""
        return {
            name: sums[: self.count] for (owner, name), sums in self._sums.items() if owner == team
        }


class TrainingEpisodes:
    """Means over episodes that begin and end in different batches of one stage.

    TorchRL's `RewardSum` and `StepCounter` do the same inside the environment, for rewards and
    steps; this one also sums the reward terms, and adds nothing to a step of the worlds.

    The worlds start new episodes after a stage. If all that end before were counted, those that
    end early would be too many: an episode counts if one of the greatest length that starts with
    it would end in the stage, too.

    Worlds that play episodes of equal length end them in the same batch. A batch in which no
    episode ends repeats the means of the last one in which some did.

    Attributes:
        last: Team to the means of the last batch in which an episode ended.
    """

    def __init__(self) -> None:
        self.last: dict[str, dict[str, float]] = {}
        self.begin_stage()

    def begin_stage(self, last_start: float = math.inf) -> None:
        """Forget the episodes that have not ended.

        Args:
            last_start: Step of the stage, from 0, at which the last episodes that count begin.
        """
        self._last_start = last_start
        self._open: dict[tuple[str, str], NDArray[np.float64]] = {}
        self._begun: dict[str, NDArray[np.int64]] = {}
        self._steps: dict[str, int] = {}

    def add(self, batch: TensorDictBase, team: str) -> dict[str, float]:
        """Return means over the episodes that ended in `batch` ``(worlds, steps)`` and count.

        Returns:
            ``episodes``, their number; ``return``, ``length`` and each reward term, see
            `team_measures`, NaN before any episode has ended; in a task with a goal ``solved``, the
            share of the episodes that ended solved; and ``reward_per_step``, the mean over all
            steps.
        """
        done = batch["next", "done"].squeeze(-1).cpu().numpy()
        counted = self._counted(team, done)
        measures = team_measures(batch["next"], team)
        ended = {
            name: values[done] if name == SOLVED else self._finish((team, name), values, done)
            for name, values in measures.items()
        }
        if counted.any():
            self.last[team] = {n: float(np.mean(ends[counted])) for n, ends in ended.items()}
        return {
            "episodes": float(np.count_nonzero(counted)),
            "reward_per_step": float(measures["return"].mean()),
            **self.last.get(team, dict.fromkeys(measures, math.nan)),
        }

    def _counted(self, team: str, done: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which of the episodes that end count, world after world."""
        worlds, steps = done.shape
        begun = self._begun.setdefault(team, np.zeros(worlds, dtype=np.int64))
        passed = self._steps.setdefault(team, 0)
        starts = []
        for world, row in enumerate(done):
            following = passed + np.flatnonzero(row) + 1
            starts.append(np.concatenate([begun[world : world + 1], following]))
            begun[world] = starts[-1][-1]
        self._steps[team] = passed + steps
        ended = np.concatenate([start[:-1] for start in starts])
        counted: NDArray[np.bool_] = ended <= self._last_start
        return counted

    def _finish(
        self, key: tuple[str, str], values: NDArray[np.float64], done: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        carried = self._open.setdefault(key, np.zeros(len(values)))
        finished: list[float] = []
        for world, row in enumerate(values):
            pieces = np.split(row, np.flatnonzero(done[world]) + 1)
            sums = [float(piece.sum()) for piece in pieces]
            sums[0] += carried[world]
            carried[world] = sums.pop()
            finished += sums
        return np.array(finished)


def stored_means(stored: Any) -> dict[str, dict[str, float]]:
    """Return what a checkpoint holds of `TrainingEpisodes.last`.

    Raises:
        ValueError: If it is something else.
    """
    teams = stored.values() if isinstance(stored, dict) else [None]
    if not all(
        isinstance(means, dict) and all(type(mean) is float for mean in means.values())
        for means in teams
    ):
        raise ValueError(f"no means of episodes: {stored!r:.80}")
    return dict(stored)
