"""Frozen episodes: the same 100 starts of a task for all evaluations of it.

Each task of the package has a file ``veca_marl/data/benchmark/<task>.json``: one seed, the
parameters of the task, and all that was drawn for each start. The randomness of an episode depends
on the seed, its number and the world alone, so that the seed is enough to play the episodes here;
the values show that they start as they did, and other programs can start from them.
``scripts/make_benchmark.py`` writes the files.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from enum import Enum
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.starts import Start, differences, start_values
from veca_marl.envs.core.task import TaskCfg

EPISODES = 100
SEED = 20260
_SHOWN = 3  # differing values in a message


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

        Parameters that the task has got since must have their former values.

        Raises:
            ValueError: If one differs; the message names them.
        """
        own, stored = parameters(cfg), {**cfg.formerly, **self.parameters}
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
    head = {key: value for key, value in vars(benchmark).items() if key != "starts"}
    entries = [f'"{key}": {json.dumps(value)}' for key, value in head.items()]
    entries += [f'"constant": {json.dumps(constant)}', '"starts": [\n' + ",\n".join(lines) + "\n]"]
    return "{\n" + ",\n".join(entries) + "\n}\n"


def from_text(text: str) -> Benchmark:
    """Return the frozen episodes that `to_text` wrote."""
    stored = json.loads(text)
    constant = stored.pop("constant")
    starts = [
        {name: tuple(value) for name, value in {**constant, **start}.items()}
        for start in stored.pop("starts")
    ]
    return Benchmark(**stored, starts=tuple(starts))


def parameters(cfg: TaskCfg | GameCfg) -> dict[str, Any]:
    """Return the parameters of a task, or of a whole game, as values of JSON."""
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
