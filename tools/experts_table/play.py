"""Frozen episodes of tasks, played by the expert or the random policy, in several processes."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from enum import Enum
from functools import partial

import numpy as np

from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.benchmark import SEED, find_benchmark, start_values
from veca_marl.envs.core.episodes import Episodes, first_team, play_to_end
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg, Script
from veca_marl.migrations import first_form
from veca_marl.processes.pool import ProcessPool


@dataclass(frozen=True)
class Job:
    """An episode that is to be played.

    Attributes:
        task: Name of the task.
        overrides: Changes of its default configuration.
        policy: What chooses the actions of the first team; other teams act at random.
        episode: Number of the frozen episode.
        frozen: Whether the start has to be the frozen one.
    """

    task: str
    overrides: tuple[str, ...]
    policy: Script
    episode: int
    frozen: bool


@dataclass(frozen=True)
class Played:
    """An episode that was played; a row of the file of its task.

    Attributes:
        policy: ``expert`` or ``random``.
        episode: Number of the frozen episode.
        score: Undiscounted return, mean over the first team.
        solved: Share of the first team for which the goal was reached after the last step; None in
            a task without a goal.
        steps: Environment steps.
        agents: Number of players of all teams.
        processor_s: Processor time of the episode with its start, s.
        configuration: `digest` of the game.
        version: Version of the frozen episodes; 0 for other starts.
        commit: Commit of the code; empty if it is not a checkout.
    """

    policy: str
    episode: int
    score: float
    solved: float | None
    steps: int
    agents: int
    processor_s: float
    configuration: str
    version: int
    commit: str


def digest(cfg: GameCfg) -> str:
    """Return 16 hexadecimal digits that change with the configuration of a game.

    They are those of its first form: rows that an earlier version stored stay valid.
    """
    plain = json.loads(json.dumps(asdict(cfg), default=_plain))
    text = json.dumps(first_form(plain), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    return value.name if isinstance(value, Enum) else str(value)


class EpisodePlayer:
    """Plays episodes, consecutive ones of one task in one world.

    Args:
        commit: Commit of the code.
    """

    def __init__(self, commit: str) -> None:
        self._commit = commit
        self._chosen: tuple[str, tuple[str, ...]] | None = None
        self._game: Game | None = None

    def play(self, job: Job) -> Played:
        """Play an episode.

        Raises:
            ValueError: If the start is not the frozen one.
        """
        if self._game is None or (job.task, job.overrides) != self._chosen:
            self.close()
            self._game = Game(game_cfg(job.task, job.overrides))
            self._chosen = job.task, job.overrides
        return _play(self._game, job, self._commit)

    def close(self) -> None:
        """Close the world."""
        if self._game is not None:
            self._game.close()
        self._game = None


def game_cfg(task: str, overrides: Sequence[str]) -> GameCfg:
    """Return the configuration of a game.

    Raises:
        ConfigError: If the configuration is impossible, or an opponent is another run.
    """
    cfg = compose([f"+task={task}", *overrides])
    if cfg.frozen:
        raise ConfigError(f"opponent: {sorted(cfg.frozen)} must be expert, random or idle")
    return cfg.game


def _play(game: Game, job: Job, commit: str) -> Played:
    team, score, began_s = first_team(game), 0.0, time.process_time()
    version = _reset(game, job)
    for outcome in play_to_end(game, job.policy):
        score += float(np.mean([game.reward_of(outcome.terms[p.name]) for p in team]))
    solved = [outcome.solved[p.name] for p in team] if game.task.has_goal() else None
    return Played(
        policy=job.policy.value,
        episode=job.episode,
        score=score,
        solved=None if solved is None else float(np.mean(solved)),
        steps=game.steps,
        agents=len(game.players),
        processor_s=time.process_time() - began_s,
        configuration=digest(game.cfg),
        version=version,
        commit=commit,
    )


def _reset(game: Game, job: Job) -> int:
    """Begin the episode of a job; return the version of the frozen episodes, 0 for other starts.

    Raises:
        ValueError: If the start has to be the frozen one and is not.
    """
    rng = Episodes(SEED, job.episode).next()
    game.reset(rng)
    if not job.frozen:
        return 0
    benchmark = find_benchmark(job.task)
    benchmark.check_starts([start_values(game, rng)], first=job.episode)
    return benchmark.version


def play_all(jobs: Sequence[Job], processes: int, commit: str) -> Iterator[tuple[Job, Played]]:
    """Play episodes and yield each when it has ended, those of several processes in any order.

    Args:
        jobs: The episodes; those of one task follow each other.
        processes: Number of processes. With 1 the episodes are played in this one.
        commit: Commit of the code.

    Raises:
        ValueError: If a start is not the frozen one, in this process.
        WorkerError: If a process ends before its episodes are played, or raises an exception.
    """
    if processes == 1:
        with closing(EpisodePlayer(commit)) as player:
            for job in jobs:
                yield job, player.play(job)
        return
    serve = partial(_serve_episodes, commit)
    with closing(ProcessPool("playing process", serve, min(processes, len(jobs)))) as pool:
        for number, played in pool.answers(jobs):
            yield jobs[number], played


def _serve_episodes(commit: str, _: Callable[[], None]) -> Callable[[Job], Played]:
    """Return what plays in a process of a pool."""
    return EpisodePlayer(commit).play
