"""Demonstrations: recorded episodes, as `veca_marl.algos.demonstration_files` describes them."""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import torch
from tensordict import TensorDict
from torch import Tensor

from veca_marl.algos.demonstration_files import (
    ACTION,
    CARD,
    END,
    INDEX,
    OUTCOME,
    STATE,
    Card,
    DemonstrationsError,
    Episode,
    Key,
    TeamForm,
    episodes_of,
    index_bytes,
)
from veca_marl.algos.mapped_files import expect_scattered_reads
from veca_marl.algos.specs import action_key

_BLOCK = 2**24  # bytes that are hashed at once


class Demonstrations:
    """Recorded episodes, read from the disk as they are needed.

    Attributes:
        folder: Where they are.
        card: What they are.
        episodes: The episodes.
        rows: All rows ``(N,)``, memory-mapped; changes of them stay in this process.

    Args:
        folder: A folder of demonstrations.
        verify: Whether to compare all bytes with the digests, which reads all of them; sizes and
            the index are always compared.

    Raises:
        DemonstrationsError: If there are none, they are not complete, truncated or altered.
    """

    def __init__(self, folder: Path | str, verify: bool = True) -> None:
        self.folder = Path(folder)
        self.card = Card.read(self.folder)
        content = index_bytes(self.folder / INDEX)
        self.episodes = episodes_of(self.folder / INDEX, content)
        self._check_complete(content)
        self._check_sizes()
        self.rows = self._map()
        if verify:
            self.verify()

    def __len__(self) -> int:
        """Return the number of episodes."""
        return len(self.episodes)

    @property
    def steps(self) -> int:
        """Steps of all episodes."""
        return sum(episode.steps for episode in self.episodes)

    def _check_complete(self, index: bytes) -> None:
        if not self.card.complete:
            raise DemonstrationsError(
                f"{self.folder} is not complete: {len(self)} of {self.card.episodes} episodes are "
                "recorded; the command that records them continues"
            )
        if hashlib.sha256(index).hexdigest() != self.card.checksum:
            raise DemonstrationsError(f"{self.folder / INDEX} was altered: not its checksum")
        if len(self) != self.card.episodes or not self.episodes:
            raise DemonstrationsError(
                f"{self.folder} has {len(self)} episodes, its card {self.card.episodes}"
            )

    def _check_sizes(self) -> None:
        rows = self.steps + len(self)
        for array in self.card.arrays:
            path, wanted = array.file(self.folder), rows * array.row_bytes
            size = path.stat().st_size if path.is_file() else None
            if size != wanted:
                found = "missing" if size is None else f"{size} bytes long, not {wanted}"
                raise DemonstrationsError(f"{path} is {found}: the data are not those recorded")

    def _map(self) -> TensorDict:
        rows = self.steps + len(self)
        mapped = TensorDict({}, [rows])
        for array in self.card.arrays:
            shape = (rows, *array.shape)
            if array.row_bytes == 0:
                mapped[array.key] = torch.zeros(shape, dtype=getattr(torch, array.dtype))
                continue
            found = np.frombuffer(_private(array.file(self.folder)), array.dtype)
            mapped[array.key] = torch.from_numpy(found.reshape(shape))
        return mapped

    def verify(self) -> None:
        """Compare all bytes with the digests.

        Raises:
            DemonstrationsError: If an episode differs.
        """
        for number, episode in enumerate(self.episodes):
            if self._digest(episode) != episode.digest:
                raise DemonstrationsError(
                    f"{self.folder}: the bytes of episode {number} were altered: not its checksum"
                )

    def _digest(self, episode: Episode) -> str:
        total = hashlib.sha256()
        first, rows = episode.first, episode.steps + 1
        for array in self.card.arrays:
            found = self.rows[array.key][first : first + rows].numpy()
            flat = found.reshape(-1).view(np.uint8)
            for start in range(0, len(flat), _BLOCK):
                total.update(flat[start : start + _BLOCK])
        return total.hexdigest()

    def keys(self, role: str) -> list[Key]:
        """Return the keys of the arrays with a role."""
        return [array.key for array in self.card.arrays if array.role == role]

    def trajectory(self, number: int) -> TensorDict:
        """Return an episode as an environment's rollout gives it, ``(steps,)``.

        Its observations, masks and actions are at the root, and under ``next`` the observations
        that follow, rewards, their terms and the flags.

        Args:
            number: Number of the episode, from 0 on.
        """
        episode = self.episodes[number]
        rows = self.rows[episode.first : episode.first + episode.steps]
        after = self.rows[episode.first + 1 : episode.first + episode.steps + 1]
        played = rows.select(*self.keys(STATE), *self.keys(ACTION))
        following = after.select(*self.keys(STATE))
        for key in self.keys(OUTCOME):
            if key != (END,):
                following[key] = rows[key]
        played["next"] = following
        return played

    def trajectories(self) -> Iterator[TensorDict]:
        """Yield all episodes, see `trajectory`."""
        return (self.trajectory(number) for number in range(len(self)))

    def weigh_rewards(self, team: str, weights: Mapping[str, float]) -> None:
        """Replace the rewards of a team by weighted sums of the stored reward terms.

        Args:
            team: Name of the team.
            weights: Weight in one step of each term; what is learnt from may weigh them otherwise
                than what was recorded.

        Raises:
            DemonstrationsError: If a term was not recorded.
        """
        present = {array.key for array in self.card.arrays}
        reward = torch.zeros_like(self.rows[team, "reward"], dtype=torch.float64)
        for name, weight in weights.items():
            if (team, "info", name) not in present:
                raise DemonstrationsError(f"{self.folder} has no reward term {name!r} of {team!r}")
            reward += weight * self.rows[team, "info", name].double()
        self.rows[team, "reward"].copy_(reward)

    def scattered(self, keys: Iterable[Key], index: Tensor) -> TensorDict:
        """Return copies of rows from anywhere, with the shape of their numbers.

        From then on nothing is read ahead, see `expect_scattered_reads`.

        Args:
            keys: Keys of arrays.
            index: Numbers of rows, int64.
        """
        flat, found = index.flatten(), TensorDict({}, index.shape)
        for key in keys:
            column: Tensor = self.rows[key]
            if column.nbytes:
                expect_scattered_reads(column)
            found[key] = column.index_select(0, flat).unflatten(0, index.shape)
        return found

    def step_rows(self) -> Tensor:
        """Return the numbers of all rows that have an action, ``(steps,)`` int64."""
        return torch.nonzero(~self.rows[END]).flatten()

    def check_team(self, team: str, form: TeamForm) -> None:
        """Check that a team of a run can learn from what a team of the same name did.

        Raises:
            DemonstrationsError: If there is none, or it has another body, senses or actions.
        """
        if team not in self.card.teams:
            found = ", ".join(sorted(self.card.teams))
            raise DemonstrationsError(f"{self.folder} demonstrates the teams {found}, not {team!r}")
        stored = self.card.teams[team]
        if differing := stored.differences(form):
            more = f" and {len(differing) - 3} more" if len(differing) > 3 else ""
            raise DemonstrationsError(
                f"{self.folder}: team {team!r} has another body, senses or actions there: "
                f"{'; '.join(differing[:3])}{more}"
            )
        needed = [action_key(team, part) for part in form.spec.actions]
        needed += [(team, "observation", sense) for sense in form.spec.observations]
        present = {array.key for array in self.card.arrays}
        if missing := [key for key in needed if key not in present]:
            raise DemonstrationsError(f"{self.folder / CARD} has no array {missing[0]}")


def _private(path: Path) -> mmap.mmap:
    """Return the content of a file; what is written to it stays in this process.

    No memory is reserved for such changes: the file may be larger than what there is.
    """
    flags = mmap.MAP_PRIVATE | getattr(mmap, "MAP_NORESERVE", 0)
    with path.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, flags=flags, prot=mmap.PROT_READ | mmap.PROT_WRITE)
