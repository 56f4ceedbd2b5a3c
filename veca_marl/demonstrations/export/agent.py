"""What one agent observed and did in demonstrations, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.algos.demonstration_files import DemonstrationsError, Key
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.specs import PLAIN, ActionLayout, ArrayLayout, action_key

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class AgentEpisode:
    """An episode of T steps of one agent, without what follows its elimination.

    Attributes:
        observations: Sense to ``(T + 1, ...)``; the last entry follows the last step.
        actions: Part of the action to ``(T, ...)``.
        rewards: ``(T,)``.
        terminated: ``(T,)``.
        truncated: ``(T,)``.
        solved: ``(T,)``; None for a task without a goal.
    """

    observations: Arrays
    actions: Arrays
    rewards: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    solved: NDArray[np.bool_] | None

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.rewards)


class DemonstratedAgent:
    """One agent of demonstrations.

    Args:
        demonstrations: The demonstrations.
        name: ``TEAM`` or ``TEAM_INDEX``; None is the only agent.

    Attributes:
        demonstrations: The demonstrations.
        observations: Sense to the layout of its array.
        actions: Part of the action to its layout.

    Raises:
        DemonstrationsError: If there is no such agent, or there are several and none is named.
    """

    def __init__(self, demonstrations: Demonstrations, name: str | None) -> None:
        self.demonstrations = demonstrations
        agents = {
            team if form.spec.agents == 1 else f"{team}_{index}": (team, index)
            for team, form in demonstrations.card.teams.items()
            for index in range(form.spec.agents)
        }
        if name is None and len(agents) == 1:
            name = next(iter(agents))
        if name not in agents:
            given = "there are several agents" if name is None else f"agent={name} is none of them"
            raise DemonstrationsError(
                f"{given}; choices: {', '.join(f'agent={a}' for a in agents)}"
            )
        self.team, self.index = agents[name]
        spec = demonstrations.card.teams[self.team].spec
        self.observations: dict[str, ArrayLayout] = dict(spec.observations)
        self.actions: dict[str, ActionLayout] = dict(spec.actions)
        self._masked = spec.masked
        self._keys = {array.key for array in demonstrations.card.arrays}

    @property
    def plain(self) -> bool:
        """Whether the action is one array."""
        return list(self.actions) == [PLAIN]

    def episode(self, number: int) -> AgentEpisode:
        """Return an episode."""
        found = self.demonstrations.episodes[number]
        steps = found.steps if not self._masked else self._steps_present(found.first, found.steps)
        first, last = found.first, found.first + steps
        flags = {
            name: self._read((self.team, name), first, last)[:, 0]
            for name in ("reward", "terminated", "truncated")
        }
        solved = (self.team, "info", "solved")
        return AgentEpisode(
            {
                sense: self._read((self.team, "observation", sense), first, last + 1)
                for sense in self.observations
            },
            {part: self._read(action_key(self.team, part), first, last) for part in self.actions},
            flags["reward"],
            flags["terminated"],
            flags["truncated"],
            self._read(solved, first, last)[:, 0] if solved in self._keys else None,
        )

    def _steps_present(self, first: int, steps: int) -> int:
        """Return the number of steps before the agent was eliminated."""
        present = self._read((self.team, "mask"), first, first + steps)
        return int(present.argmin()) if not present.all() else steps

    def _read(self, key: Key, first: int, last: int) -> NDArray[Any]:
        rows: NDArray[Any] = self.demonstrations.rows[key][first:last, self.index].numpy()
        return rows
