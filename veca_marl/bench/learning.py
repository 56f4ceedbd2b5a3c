"""Speed of learning, beside that of the simulator: which part of the cores' steps a run makes.

Cores that share caches, memory or, as hyper-threads, their arithmetic, are slower together than one
of them alone: the rate of all of them at once is the most that learning could reach.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.synchronize import Barrier
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import torch
from torchrl import timeit

from veca_marl.algos.reporting import Reporter, Row
from veca_marl.algos.training.schedule import Schedule, processor_seconds
from veca_marl.bench.rollouts import RandomActions
from veca_marl.config import Config
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.pool import ProcessPool
from veca_marl.runs.assembly import GameFactory, make_trainer
from veca_marl.runs.run_folder import RunFolder

_WAIT_S = 60.0  # until all processes begin; they differ by the time to read a message


class SimultaneousRollouts:
    """Processes that make rollouts with random actions at the same time.

    Args:
        make_env: Makes the worlds of a process, in that process.
        steps: Steps of each rollout.
        processes: Number of processes.
    """

    def __init__(self, make_env: Callable[[], VecaEnv], steps: int, processes: int) -> None:
        # kept: its shared memory is given to other arrays as soon as this process drops it
        self._begin = get_context("spawn").Barrier(processes)
        self._requests = [None] * processes
        serve = partial(_serve_rollouts, self._begin, make_env, steps)
        self._pool = ProcessPool("measuring process", serve, processes)
        self.frames_per_s()  # fills caches

    def frames_per_s(self) -> float:
        """Make one rollout in each process and return the sum of their rates.

        Raises:
            WorkerError: If a process has ended.
        """
        return math.fsum(rate for _, rate in self._pool.answers(self._requests))

    def close(self) -> None:
        """End the processes."""
        self._pool.close()


def _serve_rollouts(
    begin: Barrier, make_env: Callable[[], VecaEnv], steps: int, _: Callable[[], None]
) -> Callable[[None], float]:
    """Return what makes a rollout in a process, together with others, and measures its rate."""
    torch.set_num_threads(1)
    env = make_env()
    actions = RandomActions(env, steps)

    def frames_per_s(_: None) -> float:
        begin.wait(_WAIT_S)
        start = time.perf_counter()
        env.rollout(steps, actions, break_when_any_done=False)
        frames: int = steps * env.batch_size[0]
        return frames / (time.perf_counter() - start)

    return frames_per_s


@dataclass
class Learning:
    """Speed of a run, measured in turns with rollouts of the same worlds.

    A stage of a run is what `eval.every_frames` frames take: collection, learning, an evaluation of
    `eval.episodes` and its checkpoint. What occurs once in a run (starting, evaluating the random
    policy, the longer last evaluation, the video) is not in it.

    Attributes:
        algorithm: Name of the algorithm.
        cores: Cores of the machine.
        rollout_per_s: Frames per second of a rollout with random actions in one thread, with as
            many worlds as a worker process has; median.
        rollouts_per_s: Those of one such rollout per core at the same time; median.
        frames_per_s: Frames of experience per second of the stages; median.
        ratio: `frames_per_s` / (`cores` x `rollout_per_s`), of elapsed times; median over turns.
        ratio_at_once: `frames_per_s` / `rollouts_per_s`, likewise: 1 if learning and evaluating
            were free, also on cores that are slower together than alone.
        processor_ratio: Processor time of a frame in a rollout divided by that in a stage, of all
            its processes: `ratio` if no core was ever idle. Not a number where the system does not
            tell the processor time of other processes.
        seconds: Elapsed seconds of each part of the stages.
    """

    algorithm: str
    cores: int
    rollout_per_s: float
    rollouts_per_s: float
    frames_per_s: float
    ratio: float
    ratio_at_once: float
    processor_ratio: float
    seconds: dict[str, float]


@dataclass(frozen=True)
class Cost:
    """Elapsed and processor time of one frame.

    Attributes:
        wall_s: Elapsed seconds.
        processor_s: Seconds of processor time, of all processes.
    """

    wall_s: float
    processor_s: float


def measure_learning(cfg: Config, steps: int, stages: int) -> Learning:
    """Measure stages of a run, and a rollout after each.

    The first stage is not counted: it starts processes and fills caches.

    Args:
        cfg: The configuration of the run; its budget is replaced.
        steps: Steps of each rollout.
        stages: Number of stages.

    Raises:
        ConfigError: If the run is impossible.
    """
    log = replace(cfg.log, progress_bar=False)
    evaluation = replace(cfg.eval, final_episodes=cfg.eval.episodes)
    stage = Schedule.of(cfg.eval.every_frames, cfg.eval.every_frames, cfg.collect.frames)
    frames = (stages + 1) * stage.frames
    run = replace(cfg, log=log, eval=evaluation, total_frames=frames)
    with TemporaryDirectory() as folder:
        trainer = make_trainer(run, RunFolder(Path(folder)))
        with closing(Turns(cfg, steps)) as turns:
            trainer.reporters = [turns]
            trainer.run()
    return _summary(cfg, turns)


class Turns(Reporter):
    """A reporter that takes the time of each stage and measures a rollout after it.

    Args:
        cfg: The configuration of the run.
        steps: Steps of each rollout.

    Attributes:
        stages: Cost of a frame in each stage but the first.
        rollouts: Cost of a frame in the rollout after each of them.
        at_once: Frames per second of the rollouts on all cores after each of them.
    """

    def __init__(self, cfg: Config, steps: int) -> None:
        self.stages: list[Cost] = []
        self.rollouts: list[Cost] = []
        self.at_once: list[float] = []
        self._steps = steps
        self._env = VecaEnv(cfg.game, cfg.collect.worlds, seed=0)
        self._actions = RandomActions(self._env, steps)
        self._rollout()  # fills caches
        make_game = GameFactory(cfg.game, tuple(cfg.plugins))
        make_env = partial(make_game, cfg.collect.worlds, seed=0)
        self._all_cores = SimultaneousRollouts(make_env, steps, usable_cores())
        self._frames = 0
        self._start: Cost | None = None

    def write(self, kind: str, frames: int, row: Row) -> None:
        """See `Reporter`: a stage ends with the evaluation of its policy."""
        if kind != "evaluations" or frames == self._frames:
            return
        if self._start is None:
            timeit.erase()
        else:
            self.stages.append(_per_frame(self._start, frames - self._frames))
            self.rollouts.append(self._rollout())
            self.at_once.append(self._all_cores.frames_per_s())
        self._frames, self._start = frames, _now()

    def _rollout(self) -> Cost:
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        start = _now()
        self._env.rollout(self._steps, self._actions, break_when_any_done=False)
        cost = _per_frame(start, self._steps * self._env.batch_size[0])
        torch.set_num_threads(threads)
        return cost

    def sync(self) -> None:
        """See `Reporter`; nothing is stored."""

    def close(self) -> None:
        """Close the worlds."""
        self._env.close()
        self._all_cores.close()


def _summary(cfg: Config, turns: Turns) -> Learning:
    cores = usable_cores()
    pairs = list(zip(turns.rollouts, turns.stages, strict=True))
    return Learning(
        algorithm=cfg.algo.name,
        cores=cores,
        rollout_per_s=1.0 / median(rollout.wall_s for rollout in turns.rollouts),
        rollouts_per_s=median(turns.at_once),
        frames_per_s=1.0 / median(stage.wall_s for stage in turns.stages),
        ratio=median(rollout.wall_s / stage.wall_s for rollout, stage in pairs) / cores,
        ratio_at_once=median(
            1.0 / (stage.wall_s * rate)
            for stage, rate in zip(turns.stages, turns.at_once, strict=True)
        ),
        processor_ratio=median(r.processor_s / s.processor_s for r, s in pairs),
        seconds={part: s for part, s in timeit.todict(percall=False).items() if s > 0.0},
    )


def _per_frame(start: Cost, frames: int) -> Cost:
    now = _now()
    return Cost(
        (now.wall_s - start.wall_s) / frames, (now.processor_s - start.processor_s) / frames
    )


def _now() -> Cost:
    return Cost(time.perf_counter(), processor_seconds())
