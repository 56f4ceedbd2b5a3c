"""Random samples of demonstrations, as batches that an actor reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from veca_marl.algos.demonstration_files import Key
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.networks.memory import initial_states
from veca_marl.algos.specs import TeamSpec, action_key

COUNTED = "counted"
"""Key of ``(..., agents)`` bool, True for entries to learn from."""


@dataclass(frozen=True)
class SequenceCfg:
    """Consecutive steps of a sample, for networks with hidden state.

    Attributes:
        burn_in: Steps through which the hidden state is computed before those that are learnt.
        steps: Steps that are learnt from.
    """

    burn_in: int
    steps: int


ONE_STEP = SequenceCfg(0, 1)


class Samples:
    """Draws what a team did in demonstrations, each step of them equally often.

    Without hidden state a sample has the shape ``(rows,)``. With hidden state it has sequences,
    ``(rows / steps, burn_in + steps)``: an episode is divided into parts of so many steps, and
    before each part come the steps by which the state is computed, from zero. Steps of the
    burn-in, and what lies outside the episode, is not `COUNTED`.

    Args:
        demonstrations: Where they are drawn from.
        team: Name of the team.
        spec: Its arrays.
        actor: Reads them; says whether there is hidden state.
        sequence: Steps of a sequence; not used without hidden state.
        episodes: Numbers of the episodes to draw from.
    """

    def __init__(
        self,
        demonstrations: Demonstrations,
        team: str,
        spec: TeamSpec,
        actor: TensorDictModuleBase,
        sequence: SequenceCfg,
        episodes: Sequence[int],
    ) -> None:
        self._demonstrations, self._team = demonstrations, team
        self._spec, self._actor = spec, actor
        self._recurrent = bool(initial_states(actor, ()))
        self._sequence = sequence if self._recurrent else ONE_STEP
        self._keys: list[Key] = [(team, "observation", sense) for sense in spec.observations]
        self._keys += [(team, "mask")] if spec.masked else []
        self._keys += [action_key(team, part) for part in spec.actions]
        chosen = [demonstrations.episodes[number] for number in episodes]
        first = torch.tensor([episode.first for episode in chosen])
        steps = torch.tensor([episode.steps for episode in chosen])
        self._parts, self._begins, self._ends = _parts(first, steps, self._sequence.steps)

    @property
    def steps(self) -> int:
        """Number of different steps that can be drawn."""
        return int(
            (torch.minimum(self._parts + self._sequence.steps, self._ends) - self._parts).sum()
        )

    def draw(self, rows: int) -> TensorDict:
        """Return a random sample.

        Args:
            rows: Steps that are learnt from; rounded down to whole sequences, at least one.
        """
        span = self._sequence
        number = torch.randint(len(self._parts), (max(1, rows // span.steps),))
        if not self._recurrent:
            return self._read(self._parts[number], torch.ones(len(number), dtype=torch.bool))
        offsets = torch.arange(-span.burn_in, span.steps)
        index = self._parts[number].unsqueeze(1) + offsets
        begins, ends = self._begins[number].unsqueeze(1), self._ends[number].unsqueeze(1)
        valid = (index >= begins) & (index < ends)
        sample = self._read(index.clamp(begins, ends - 1), valid & (offsets >= 0))
        starts = valid.clone()
        starts[:, 1:] &= ~valid[:, :-1]
        starts[:, 0] = True
        sample["is_init"] = starts.unsqueeze(-1)
        for key, state in initial_states(self._actor, tuple(index.shape)).items():
            sample[key] = state
        return sample

    def _read(self, index: Tensor, counted: Tensor) -> TensorDict:
        sample = self._demonstrations.scattered(self._keys, index)
        every = counted.unsqueeze(-1).expand(*counted.shape, self._spec.agents)
        sample[COUNTED] = every & sample[self._team, "mask"] if self._spec.masked else every
        return sample


def _parts(first: Tensor, steps: Tensor, length: int) -> tuple[Tensor, Tensor, Tensor]:
    """Return the first row of each part, and the first and the last row but one of its episode."""
    counts = (steps + length - 1) // length
    episode = torch.repeat_interleave(torch.arange(len(first)), counts)
    before = torch.cumsum(counts, 0) - counts
    number = torch.arange(len(episode)) - before[episode]
    begins = first[episode]
    return begins + number * length, begins, begins + steps[episode]
