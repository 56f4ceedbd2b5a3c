"""Snapshots: the whole state of a game, from which it continues as if it had gone on."""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from veca_marl.envs.core.built_objects import BuiltObjects, SnapshotError
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.object_states import Capture, ObjectStates, Putting
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.physics.world_state import SavedPhysics
from veca_marl.stored_files import StoredFileError, read_bytes

_FORMAT = 1
_LARGEST = 500_000_000  # bytes of a file; a game of two full bodies has about 3 MB
_LARGEST_STRUCTURE = 50_000_000
_STRUCTURE, _PHYSICS = "structure.json", "physics.bullet"


@dataclass(frozen=True)
class Snapshot:
    """The state of one game between two steps: physics, bodies, senses, sounds on their way, task.

    Attributes:
        task: Name of the task.
        built: Digest of the configuration and of what it builds; other games are not restored.
        states: Contents of all objects of the game that change.
        physics: What Bullet knows.
        episodes: `Episodes.state` of the world that it is of.
    """

    task: str
    built: str
    states: ObjectStates
    physics: SavedPhysics
    episodes: tuple[int, int, int]

    def save(self, path: str | Path) -> None:
        """Store it in a file, a ZIP archive of JSON and arrays, which `load` reads.

        Raises:
            OSError: If the file cannot be written; an earlier one of the name is kept.
        """
        path = Path(path)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file, zipfile.ZipFile(file, "w") as archive:
                _write(self, archive)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise

    @staticmethod
    def load(path: str | Path) -> Snapshot:
        """Read a stored snapshot. Nothing in it is executed.

        Raises:
            SnapshotError: If it is damaged, or of another version of the format.
        """
        path = Path(path)
        try:
            content = read_bytes(path, _LARGEST)
        except StoredFileError as error:
            raise SnapshotError(str(error)) from error
        with _damage(path), zipfile.ZipFile(io.BytesIO(content)) as archive:
            return _read(archive)


class Snapshots:
    """Takes snapshots of games of one configuration.

    What never changes, such as tables of a head's responses, is left out: it is what two games have
    in common. The first use builds a second game to find that.

    Args:
        game: One of the games.
    """

    def __init__(self, game: Game) -> None:
        built, other = _built(game), Game(game.cfg)
        try:
            self._constant = built.shared_with(other.built)
        finally:
            other.close()

    def take(self, game: Game, episodes: tuple[int, int, int]) -> Snapshot:
        """Return the present state of a game.

        Args:
            game: The game; an episode has begun.
            episodes: `Episodes.state` of its world.

        Raises:
            RuntimeError: If no episode has begun, or the state is no longer finite.
            SnapshotError: If an object of the game is no data, such as a generator that runs.
        """
        if not game.has_begun:
            raise RuntimeError("no episode has begun: call reset() before snapshot()")
        if game.broken:
            raise RuntimeError("the simulation is no longer finite: call reset()")
        states = Capture(game.built, self._constant).states()
        physics = game.world.save_physics()
        return Snapshot(game.cfg.task.name, _digest(game), states, physics, episodes)


class Restoring:
    """A snapshot that was checked against the game that it is to be restored in.

    A game with a state that is no longer finite is first built again, see `Game.rebuild`.

    Args:
        game: The game.
        snapshot: Of a game with an equal configuration and version, also of another process.

    Attributes:
        episodes: Those that follow the present one.

    Raises:
        SnapshotError: If it is that of another configuration or version, or damaged. The game is as
            it was.
    """

    def __init__(self, game: Game, snapshot: Snapshot) -> None:
        if snapshot.task != game.cfg.task.name:
            raise SnapshotError(
                f"the snapshot is of {snapshot.task}, the game is {game.cfg.task.name}"
            )
        if game.broken:
            game.rebuild()
        if snapshot.built != _digest(game):
            raise SnapshotError(
                f"the snapshot of {snapshot.task} is of another configuration, or of another "
                "version of veca_marl or a plug-in: make the environment with the same arguments"
            )
        self._world, self._physics = game.world, snapshot.physics
        self._putting = Putting(snapshot.states, game.built)
        try:
            self.episodes = Episodes.at(snapshot.episodes)
        except ValueError as error:
            raise SnapshotError(f"the snapshot is damaged: {error}") from error

    def restore(self) -> None:
        """Return the game to the state of the snapshot.

        Raises:
            SnapshotError: If Bullet does not take the state of the physics.
        """
        try:
            self._world.restore_physics(self._physics, self._putting.put)
        except pybullet.error as error:
            raise SnapshotError(f"the snapshot does not fit this game: {error}") from error


def restore(game: Game, snapshot: Snapshot) -> None:
    """Return a game to the state of a snapshot, see `Restoring`."""
    Restoring(game, snapshot).restore()


def _built(game: Game) -> BuiltObjects:
    try:
        return game.built
    except AttributeError as error:  # a game on a server
        raise SnapshotError(f"it has no snapshots: {error}") from error


def _digest(game: Game) -> str:
    """Return a digest of the configuration of a game and of the classes of its objects."""
    kinds = [f"{type(each).__module__}.{type(each).__qualname__}" for each in _built(game).objects]
    text = json.dumps([_FORMAT, repr(game.cfg), kinds])
    return hashlib.sha256(text.encode()).hexdigest()


def _write(snapshot: Snapshot, archive: zipfile.ZipFile) -> None:
    arrays: list[np.ndarray[Any, Any]] = []

    def without_array(content: Any) -> Any:
        if content[0] != "array":
            return content
        arrays.append(content[1])
        return "array", len(arrays) - 1, content[2]

    states = snapshot.states
    structure = {
        "format": _FORMAT,
        "task": snapshot.task,
        "digest": snapshot.built,
        "gravity": snapshot.physics.gravity,
        "episodes": snapshot.episodes,
        "built": [[number, without_array(each)] for number, each in states.built.items()],
        "made": [without_array(each) for each in states.made],
    }
    archive.writestr(_STRUCTURE, json.dumps(structure))
    archive.writestr(_PHYSICS, snapshot.physics.state)
    for number, array in enumerate(arrays):
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, array, allow_pickle=False)
        archive.writestr(_array_name(number), buffer.getvalue())


def _array_name(number: int) -> str:
    return f"{number}.npy"


def _read(archive: zipfile.ZipFile) -> Snapshot:
    entries = archive.infolist()
    if any(each.file_size != each.compress_size for each in entries):
        raise SnapshotError("it is compressed, which snapshots are not")
    if sum(each.file_size for each in entries) > _LARGEST:
        raise SnapshotError(f"its parts have more than {_LARGEST} bytes")
    if archive.getinfo(_STRUCTURE).file_size > _LARGEST_STRUCTURE:
        raise SnapshotError(f"{_STRUCTURE} has more than {_LARGEST_STRUCTURE} bytes")
    structure = json.loads(archive.read(_STRUCTURE))
    if structure["format"] != _FORMAT:
        raise SnapshotError(f"it has the format {structure['format']}, not {_FORMAT}")
    names = {_array_name(number) for number in range(len(entries))} & set(archive.namelist())

    def with_array(content: Any) -> Any:
        if content[0] != "array":
            return content
        name = _array_name(content[1])
        names.remove(name)  # each is the content of one object
        return "array", _array(archive.read(name)), content[2]

    states = ObjectStates(
        {int(number): with_array(each) for number, each in structure["built"]},
        [with_array(each) for each in structure["made"]],
    )
    x, y, z = map(float, structure["gravity"])
    seed, world, number = map(int, structure["episodes"])
    physics = SavedPhysics(archive.read(_PHYSICS), (x, y, z))
    task, digest = str(structure["task"]), str(structure["digest"])
    return Snapshot(task, digest, states, physics, (seed, world, number))


def _array(content: bytes) -> np.ndarray[Any, Any]:
    """Return an array in NumPy's format, of which nothing is allocated but what is there."""
    buffer = io.BytesIO(content)
    if np.lib.format.read_magic(buffer) != (1, 0):
        raise SnapshotError("an array is of another version of NumPy's format")
    shape, by_columns, dtype = np.lib.format.read_array_header_1_0(buffer)
    present = len(content) - buffer.tell()
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != present:
        raise SnapshotError(f"an array {dtype}{shape} has {present} bytes")
    flat = np.frombuffer(content, dtype, math.prod(shape), buffer.tell())
    return flat.reshape(shape, order="F" if by_columns else "C").copy(order="K")


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn the errors of a damaged file into one line that names it."""
    try:
        yield
    except (
        zipfile.BadZipFile, LookupError, TypeError, ValueError, EOFError, OSError, RuntimeError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split())
        raise SnapshotError(f"{path} is no snapshot, or damaged: {reason}") from error


__all__ = ["Restoring", "Snapshot", "SnapshotError", "Snapshots", "restore"]
