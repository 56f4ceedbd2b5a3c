"""Rows of a replay buffer: each observation once, in segments that follow each other in time.

A segment holds consecutive steps of one world and, as its last row, the observation that follows
them: the true last observation of an episode that was truncated, or the first one that the next
batch begins with. Where an episode or a batch ends, its segment ends. Rows of different worlds,
episodes, batches and stages are therefore never connected.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from veca_marl.algos.specs import TeamSpec, action_key

END = "end"  # True for the last row of a segment, which has no action
PLACE = "place"  # number of the row in its segment, from 0

Key = tuple[str, ...]


@dataclass(frozen=True)
class StoredKeys:
    """What is stored of one team, beside its reward and its flag ``terminated``.

    Attributes:
        team: Name of the team.
        observation: Observations.
        mask: The mask, where agents can be eliminated.
        memory: Hidden states.
        action: Parts of the action; zeros in the last row of a segment.
    """

    team: str
    observation: tuple[Key, ...]
    mask: tuple[Key, ...]
    memory: tuple[Key, ...]
    action: tuple[Key, ...]

    @property
    def state(self) -> tuple[Key, ...]:
        """What a row has before its action."""
        return (*self.observation, *self.mask, *self.memory)

    @property
    def all(self) -> tuple[Key | str, ...]:
        """Everything that is stored."""
        outcome = ((self.team, "reward"), (self.team, "terminated"))
        return (*self.state, *self.action, *outcome, END, PLACE)

    @classmethod
    def of(cls, team: str, spec: TeamSpec, memory: tuple[Key, ...] = ()) -> StoredKeys:
        """Return the keys of a team with these arrays and these hidden states."""
        observations = tuple((team, "observation", name) for name in spec.observations)
        mask: tuple[Key, ...] = ((team, "mask"),) if spec.masked else ()
        actions = tuple(action_key(team, part) for part in spec.actions)
        return cls(team, observations, mask, memory, actions)


def segment_rows(batch: TensorDictBase, keys: StoredKeys) -> TensorDict:
    """Return the rows ``(n,)`` of all segments of a batch, world by world.

    Args:
        batch: Experience ``(worlds, steps)``.
        keys: What is stored.

    Returns:
        The keys given, ``(team, "reward")`` and ``(team, "terminated")`` of the step that begins
        in the row, `END` and `PLACE`.
    """
    cut = batch["next", "done"].squeeze(-1).clone()
    cut[:, -1] = True
    cut = cut.flatten()
    steps = _steps(batch, keys).flatten()
    finals = _finals(batch["next"].select(*keys.state).flatten()[cut], steps)
    places = torch.arange(len(cut)) + cut.cumsum(0) - cut.long()
    rows = steps.new_empty(len(steps) + len(finals))
    rows[places] = steps
    rows[places[cut] + 1] = finals
    rows[PLACE] = _places(rows[END])
    return rows


def _places(end: Tensor) -> Tensor:
    """Return the number of each row in its segment, counted from 0."""
    rows = torch.arange(len(end))
    first = torch.cat([torch.ones(1, dtype=torch.bool), end[:-1]])
    return rows - (rows * first).cummax(0).values


def _steps(batch: TensorDictBase, keys: StoredKeys) -> TensorDictBase:
    steps = batch.select(*keys.state, *keys.action).detach()
    for name in ("reward", "terminated"):
        steps[keys.team, name] = batch["next", keys.team, name]
    steps[END] = torch.zeros(batch.shape, dtype=torch.bool)
    return steps


def _finals(states: TensorDictBase, steps: TensorDictBase) -> TensorDictBase:
    """Return rows with `states` and zeros for everything else."""
    finals = steps[: len(states)].apply(torch.zeros_like)
    finals.update(states)
    finals[END] = torch.ones(len(states), dtype=torch.bool)
    return finals
