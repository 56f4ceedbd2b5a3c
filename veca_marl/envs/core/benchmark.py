"""Frozen episodes: the same 100 starts of a task for all evaluations of it, as numbers.

Each task of the package has a file ``veca_marl/data/benchmark/<task>.json``: one seed, the
parameters of the task, and all that was drawn for each start. The randomness of an episode depends
on the seed, its number and the world alone, so that the seed is enough to play the episodes here;
the values show that they start as they did, and other programs can start from them.
``python -m tools.make_benchmark`` writes the files, in a checkout.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from copy import deepcopy
from dataclasses import asdict, dataclass
from enum import Enum
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import numpy as np

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TaskCfg
from veca_marl.migrations import KEY, migrated, numbered
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Scene, matrix_to_quaternion
from veca_marl.sim.physics import Prop

Start = dict[str, tuple[float, ...]]
"""Values of the start of an episode by name, such as ``ball/position``; see `start_values`."""

NEXT_NUMBER = "next_random_number"
"""Name of the number in [0, 1) that the generator of the episode would draw after the reset."""

_DECIMALS = 6  # m and elements of rotations; processors differ in the last of 16 digits
_TOLERANCE = 1e-5


def start_state(game: Game) -> Floats:
    """Return the poses of all bones and props after `Game.reset`, rounded to 6 decimals.

    Returns:
        ``(n,)``: positions in m and rotation matrices of the bones of each player and of each prop,
        in the order in which they were added to the world.
    """
    poses = [
        array
        for player in game.players
        for array in (player.body.bone_positions(), player.body.bone_rotations())
    ]
    poses += [a for prop in game.world.props.values() for a in (prop.position, prop.rotation)]
    state = np.concatenate([np.asarray(array, np.float64).ravel() for array in poses])
    rounded: Floats = np.round(state, _DECIMALS) + 0.0  # -0.0 becomes 0.0
    return rounded


def start_values(game: Game, rng: np.random.Generator) -> Start:
    """Return all that a reset can set, rounded to 6 decimals.

    Names begin with that of a player or prop. A player has ``position`` (m) and ``quaternion``
    (x, y, z, w) of the pelvis, ``joints`` (82 angles, rad) and ``muted`` (0 or 1). A prop has
    ``position``, ``quaternion``, ``velocity`` (m/s, of its centre of mass) and ``colour`` (of its
    first primitive), with a joint also ``opening`` and ``locked``. `NEXT_NUMBER` changes with the
    number of draws, and thus with draws that set nothing of these, such as an order of targets.

    Args:
        game: A game that has just been reset.
        rng: The generator with which it was reset; it is not changed.
    """
    start: Start = {}
    for player in game.players:
        _add(start, player.name, _body_values(player.body))
    for prop in game.world.props.values():
        _add(start, prop.name, _prop_values(prop, game.world.scene))
    start[NEXT_NUMBER] = _rounded(deepcopy(rng).random())
    return start


def differences(found: Start, stored: Start) -> list[str]:
    """Return the differences of two starts in words, one for each value; none if they are equal.

    Numbers may differ by 1e-5, which is more than processors do, and quaternions by their sign.
    """
    missing = [f"{name} is missing" for name in stored if name not in found]
    added = [f"{name} is new" for name in found if name not in stored]
    changed = [
        f"{name} {_change(value, stored[name])}"
        for name, value in found.items()
        if name in stored and not _equal(name, value, stored[name])
    ]
    return [*missing, *added, *changed]


def _add(start: Start, name: str, values: Mapping[str, object]) -> None:
    start.update({f"{name}/{key}": _rounded(value) for key, value in values.items()})


def _body_values(body: Body) -> dict[str, object]:
    return {
        "position": body.position,
        "quaternion": matrix_to_quaternion(body.bone_rotations()[0]),
        "joints": body.joint_angles(),
        "muted": body.muted,
    }


def _prop_values(prop: Prop, scene: Scene) -> dict[str, object]:
    shown = scene.objects[prop.object_id]
    values = {
        "position": prop.position,
        "quaternion": matrix_to_quaternion(prop.rotation),
        "velocity": prop.velocity,
        "colour": scene.surfaces.colours[shown.geoms.start],
    }
    if prop.joint is None:
        return values
    return {**values, "opening": prop.opening, "locked": prop.locked}


def _rounded(value: object) -> tuple[float, ...]:
    rounded = np.round(np.asarray(value, np.float64), _DECIMALS) + 0.0  # -0.0 becomes 0.0
    return tuple(rounded.ravel().tolist())


def _equal(name: str, one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    if len(one) != len(other):
        return False
    signs = (1.0, -1.0) if name.endswith("/quaternion") else (1.0,)
    return any(np.allclose(one, np.multiply(sign, other), 0.0, _TOLERANCE) for sign in signs)


def _change(value: tuple[float, ...], stored: tuple[float, ...]) -> str:
    """Return the change of a value in words; of many numbers, how many differ and the first."""
    pairs = list(zip(value, stored, strict=False))
    if len(value) != len(stored) or len(pairs) <= _SHOWN_NUMBERS:
        return f"is {_words(value)} (not {_words(stored)})"
    differing = [n for n, (one, other) in enumerate(pairs) if not abs(one - other) <= _TOLERANCE]
    one, other = pairs[differing[0]]
    where = f"differs in {len(differing)} of {len(pairs)} numbers"
    return f"{where}: that of index {differing[0]} is {one:g} (not {other:g})"


def _words(value: tuple[float, ...]) -> str:
    shown = ", ".join(f"{number:g}" for number in value[:_SHOWN_NUMBERS])
    return f"{shown}, ... ({len(value)} numbers)" if len(value) > _SHOWN_NUMBERS else shown


EPISODES = 100
SEED = 20260
_SHOWN, _SHOWN_NUMBERS = 3, 4  # differing values in a message, and numbers of one value


@dataclass(frozen=True)
class Benchmark:
    """The frozen episodes of one task.

    Attributes:
        task: Name of the task.
        version: Increases whenever the episodes or the parameters of the task change.
        seed: Seed of all episodes; episode n is episode 0 of world n.
        parameters: Parameters of the task (`TaskCfg`), as plain values.
        starts: `start_values` of each episode.
    """

    task: str
    version: int
    seed: int
    parameters: dict[str, Any]
    starts: tuple[Start, ...]

    def check(self, cfg: GameCfg) -> None:
        """Check that a game is that of the benchmark, with all its starts.

        Raises:
            ValueError: If a parameter of the task or a start differs; the message names them.
        """
        self.check_parameters(cfg.task)
        self.check_starts(read_starts(cfg, self.seed, range(len(self.starts))))

    def check_parameters(self, cfg: TaskCfg) -> None:
        """Check that the parameters of a task are those of the benchmark.

        Raises:
            ValueError: If one differs; the message names them.
        """
        own, stored = parameters(cfg), self.parameters
        differing = sorted(name for name in {*own, *stored} if own.get(name) != stored.get(name))
        if differing:
            changes = [f"task.{n}={own.get(n)} (not {stored.get(n)})" for n in differing]
            raise ValueError(f"episodes=benchmark: {self._name} differs in {', '.join(changes)}")

    def check_starts(self, found: Sequence[Start], first: int = 0) -> None:
        """Check that episodes start as those of the benchmark.

        Args:
            found: `start_values` of consecutive episodes.
            first: Number of the first of them.

        Raises:
            ValueError: If a start differs; the message names the values of the first.
        """
        stored = self.starts[first : first + len(found)]
        changes = [differences(*pair) for pair in zip(found, stored, strict=True)]
        others = [number for number, change in enumerate(changes) if change]
        if others:
            names = changes[others[0]]
            more = f" and {len(names) - _SHOWN} others" if len(names) > _SHOWN else ""
            raise ValueError(
                f"episodes=benchmark: {len(others)} of {len(found)} starts are not those of "
                f"{self._name} in episode {first + others[0]} {'; '.join(names[:_SHOWN])}{more}: "
                "another playground or body was chosen, or the task has changed"
            )

    @property
    def _name(self) -> str:
        return f"the benchmark of {self.task}, version {self.version},"

    def __str__(self) -> str:
        return (
            f"benchmark of {self.task}, version {self.version}: {len(self.starts)} frozen episodes"
        )


def has_benchmark(task: str) -> bool:
    """Return whether a task has frozen episodes."""
    return _file_of(task).is_file()


def find_benchmark(task: str) -> Benchmark:
    """Return the frozen episodes of a task.

    Raises:
        ValueError: If the task has none.
    """
    if not has_benchmark(task):
        raise ValueError(f"task {task!r} has no frozen episodes")
    return from_text(_file_of(task).read_text(encoding="utf-8"))


def _file_of(task: str) -> Traversable:
    return files("veca_marl") / "data" / "benchmark" / f"{task}.json"


def to_text(benchmark: Benchmark) -> str:
    """Return the JSON of frozen episodes, with one line for each start.

    What is the same in all starts stands once, in ``constant``.
    """
    first = benchmark.starts[0]
    constant = {
        name: value
        for name, value in first.items()
        if all(start.get(name) == value for start in benchmark.starts)
    }
    lines = [
        json.dumps({name: value for name, value in start.items() if name not in constant})
        for start in benchmark.starts
    ]
    head = numbered({key: value for key, value in vars(benchmark).items() if key != "starts"})
    entries = [f'"{key}": {json.dumps(value)}' for key, value in head.items()]
    entries += [f'"constant": {json.dumps(constant)}', '"starts": [\n' + ",\n".join(lines) + "\n]"]
    return "{\n" + ",\n".join(entries) + "\n}\n"


def from_text(text: str) -> Benchmark:
    """Return the frozen episodes that `to_text` wrote.

    Raises:
        ValueError: If a newer version of the package has written them.
    """
    stored = json.loads(text)
    task = {KEY: stored.pop(KEY, 0), "task": stored.pop("parameters")}
    constant = stored.pop("constant")
    starts = [
        {name: tuple(value) for name, value in {**constant, **start}.items()}
        for start in stored.pop("starts")
    ]
    return Benchmark(**stored, parameters=migrated(task)["task"], starts=tuple(starts))


def parameters(cfg: Any) -> dict[str, Any]:
    """Return the parameters of a task, a body, a sense or a whole game as values of JSON.

    Args:
        cfg: A dataclass of a configuration.
    """
    values: dict[str, Any] = json.loads(json.dumps(asdict(cfg), default=_plain))
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name
    raise TypeError(f"{value!r} is no value of a configuration")


def read_starts(cfg: GameCfg, seed: int, numbers: Iterable[int]) -> list[Start]:
    """Return `start_values` of some episodes.

    Args:
        cfg: The game.
        seed: Seed of the episodes.
        numbers: Numbers of the episodes.
    """
    found = []
    with closing(Game(cfg)) as game:
        for number in numbers:
            rng = Episodes(seed, number).next()
            game.reset(rng)
            found.append(start_values(game, rng))
    return found
