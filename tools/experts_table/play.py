"""Frozen episodes of tasks, played by the expert or the random policy, in several processes."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from enum import Enum
from itertools import groupby
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

import numpy as np

from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.benchmark import SEED, find_benchmark, start_values
from veca_marl.envs.core.episodes import Episodes, first_team, play_to_end
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg, Script
from veca_marl.migrations import first_form


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
    text = json.dumps(first_form(asdict(cfg)), default=_plain, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    return value.name if isinstance(value, Enum) else str(value)


def play_in_order(jobs: Iterable[Job], commit: str) -> Iterator[tuple[Job, Played]]:
    """Play episodes one after the other and yield each when it has ended.

    Args:
        jobs: The episodes. Consecutive ones of one task are played in one world.
        commit: Commit of the code.

    Raises:
        ValueError: If a start is not the frozen one.
    """
    for (task, overrides), group in groupby(jobs, lambda job: (job.task, job.overrides)):
        cfg = game_cfg(task, overrides)
        with closing(Game(cfg)) as game:
            for job in group:
                yield job, _play(game, job, commit)


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


class LostProcessError(RuntimeError):
    """A process ended before it had played its episodes."""


def play_all(jobs: Sequence[Job], processes: int, commit: str) -> Iterator[tuple[Job, Played]]:
    """Play episodes and yield each when it has ended, those of several processes in any order.

    Args:
        jobs: The episodes; those of one task follow each other.
        processes: Number of processes. With 1 the episodes are played in this one.
        commit: Commit of the code.

    Raises:
        ValueError: If a start is not the frozen one.
        LostProcessError: If a process ends before its episodes are played.
    """
    if processes == 1:
        yield from play_in_order(jobs, commit)
        return
    context = get_context("spawn")  # this process may have threads, which a fork would break
    running = {}
    for share in (jobs[n::processes] for n in range(processes)):
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=_play_share, args=(share, commit, sender), daemon=True)
        process.start()
        sender.close()
        running[receiver] = process
    try:
        yield from _received(running)
    finally:
        for process in running.values():
            process.terminate()
            process.join()


def _play_share(share: Sequence[Job], commit: str, results: Connection) -> None:
    """Play in a process of its own and send each episode, then None, or else the error."""
    try:
        for played in play_in_order(share, commit):
            results.send(played)
        results.send(None)
    except ValueError as error:
        results.send(error)


def _received(running: Mapping[Connection, BaseProcess]) -> Iterator[tuple[Job, Played]]:
    connections = list(running)
    while connections:
        for connection in wait(connections):
            assert isinstance(connection, Connection)
            try:
                message = connection.recv()
            except EOFError:
                raise _lost(running[connection]) from None
            if isinstance(message, ValueError):
                raise message
            if message is None:
                connections.remove(connection)
            else:
                yield message


def _lost(process: BaseProcess) -> LostProcessError:
    process.join()
    code = process.exitcode or 0
    how = f"by signal {-code}" if code < 0 else f"with exit status {code}"
    return LostProcessError(
        f"the process {process.pid}, which played episodes, ended {how}; the episodes before are "
        "stored, and the same command plays the others"
    )
