"""Frozen episodes: the same 100 starts of a task for everyone who evaluates on it.

Each task of the package has a file ``veca_marl/data/benchmark/<task>.json``. The randomness of an
episode depends on the seed, its number and the world alone, so the file has one seed, the
parameters of the task, and a digest of each start, by which a change of the task is noticed.
``scripts/make_benchmark.py`` writes the files.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from enum import Enum
from importlib.resources import files
from typing import Any

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.starts import start_digest
from veca_marl.envs.core.task import TaskCfg

EPISODES = 100
SEED = 20260


@dataclass(frozen=True)
class Benchmark:
    """The frozen episodes of one task.

    Attributes:
        task: Name of the task.
        version: Increases whenever the episodes or the parameters of the task change.
        seed: Seed of all episodes; episode n is episode 0 of world n.
        parameters: Parameters of the task (`TaskCfg`), as plain values.
        starts: `start_digest` of each episode.
    """

    task: str
    version: int
    seed: int
    parameters: dict[str, Any]
    starts: tuple[str, ...]

    def check(self, cfg: GameCfg) -> None:
        """Check that a game is that of the benchmark, with all its starts.

        Raises:
            ValueError: If a parameter of the task or a start differs; the message names them.
        """
        self.check_parameters(cfg.task)
        self.check_starts(start_digests(cfg, self.seed, range(len(self.starts))))

    def check_parameters(self, cfg: TaskCfg) -> None:
        """Check that the parameters of a task are those of the benchmark.

        Raises:
            ValueError: If one differs; the message names them.
        """
        own = parameters(cfg)
        differing = sorted(
            name for name in {*own, *self.parameters} if own.get(name) != self.parameters.get(name)
        )
        if differing:
            changes = [f"task.{n}={own.get(n)} (not {self.parameters.get(n)})" for n in differing]
            raise ValueError(f"episodes=benchmark: {self._name} differs in {', '.join(changes)}")

    def check_starts(self, found: Sequence[str], first: int = 0) -> None:
        """Check that episodes start as those of the benchmark.

        Args:
            found: `start_digest` of consecutive episodes.
            first: Number of the first of them.

        Raises:
            ValueError: If a start differs.
        """
        stored = self.starts[first : first + len(found)]
        others = [n for n, (a, b) in enumerate(zip(found, stored, strict=True), first) if a != b]
        if others:
            raise ValueError(
                f"episodes=benchmark: {len(others)} of {len(found)} starts are not those of "
                f"{self._name}, the first is that of episode {others[0]}: another playground or "
                "body was chosen, or the task has changed"
            )

    @property
    def _name(self) -> str:
        return f"the benchmark of {self.task}, version {self.version},"

    def __str__(self) -> str:
        return (
            f"benchmark of {self.task}, version {self.version}: {len(self.starts)} frozen episodes"
        )


def find_benchmark(task: str) -> Benchmark:
    """Return the frozen episodes of a task.

    Raises:
        ValueError: If the task has none.
    """
    file = files("veca_marl") / "data" / "benchmark" / f"{task}.json"
    if not file.is_file():
        raise ValueError(f"episodes=benchmark: task {task!r} has no frozen episodes")
    stored = json.loads(file.read_text(encoding="utf-8"))
    return Benchmark(**{**stored, "starts": tuple(stored["starts"])})


def parameters(cfg: TaskCfg) -> dict[str, Any]:
    """Return the parameters of a task as values of JSON."""
    values: dict[str, Any] = json.loads(json.dumps(asdict(cfg), default=_plain))
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name
    raise TypeError(f"{value!r} is no value of a configuration")


def start_digests(cfg: GameCfg, seed: int, numbers: Iterable[int]) -> list[str]:
    """Return `start_digest` of some episodes.

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
            found.append(start_digest(game, rng))
    return found
