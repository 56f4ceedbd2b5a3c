"""Play for long and look whether anything grows: ``make soak``, an hour; ``MINUTES=10`` for less.

One process plays rounds: rude actions in every task, then a short training run with worker
processes. After each round it counts its memory, open files, processes, shared memory and the
processor time of a step, in units of a fixed workload. Beside it, a process for each further core,
at least one, plays rude actions only, one gives random content to the parsers, and one tries random
configurations, 10 000 in an hour. The figures go to a page, docs/reliability.md; the exit status is
1 if anything grew or failed.

    python -m tools.soak minutes=60 to=docs/reliability.md
"""

from __future__ import annotations

import gc
import json
import math
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO

import numpy as np
import torch

import veca_marl
from tools.checkout import check_imported
from tools.soak_page import Actions, Configurations, Parsers, Sample, Soak, page
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.bench.command import machine_line
from veca_marl.bench.rollouts import ReferenceWorkload
from veca_marl.config import ConfigError, compose, compose_node
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.processes.children import end_of
from veca_marl.processes.cores import usable_cores

_ROOT = Path(__file__).parents[1]
_HELPERS = _ROOT / "tests" / "helpers"
_STEPS = 600  # of each task in a round
_OBSERVED_EVERY = 5
_CONFIGURATION_S = 120
_CHANGES = 15  # of each set of presets, which Hydra composes once
_CONFIGURATIONS = 10_000 / 60.0  # of each minute; then their process leaves its core to the others
_BESIDE = ("parsers", "configurations", "actions")
_LARGEST_BYTES = 8 * 2**30  # address space of what tries configurations: others use the memory too
_SHARED_MEMORY = Path("/dev/shm")
_RUN = (
    *(
        "collect.groups=2",
        "collect.processes=2",
        "collect.worlds=1",
        "collect.steps=16",
        "task.max_seconds=0.5",
    ),
    *("eval.every_frames=64", "eval.episodes=2", "eval.worlds=2", "log=silent", "threads=1"),
)


@dataclass
class SoakOptions:
    """Options of the command.

    Attributes:
        minutes: How long.
        seed: Chooses actions and configurations.
        to: File of the page.
        part: ``all``, or what runs beside the worlds and prints its results: ``parsers``,
            ``configurations``, ``actions``.
    """

    minutes: float = 60.0
    seed: int = 0
    to: str = "runs/reliability.md"
    part: str = "all"

    def __post_init__(self) -> None:
        if not self.minutes > 0:
            raise ValueError(f"minutes must be positive, got {self.minutes}")
        if self.part not in ("all", *_BESIDE):
            raise ValueError(f"part={self.part}: choices: all, {', '.join(_BESIDE)}")


class Worlds:
    """Rude actions in all tasks in turn.

    Args:
        seed: Chooses the actions.

    Attributes:
        actions: Actions that were given so far, one for each agent and step.
        problems: What was wrong after a step.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        self._rude = import_module("rude_actions").rude_actions
        self._inspection = import_module("inspection")
        self._workload = ReferenceWorkload()
        self.actions = 0
        self.problems: list[str] = []

    def round(self, number: int) -> float:
        """Play some steps of every task; return the processor time of one, in workloads."""
        ratios = []
        for task in veca_marl.list_tasks():
            game = Game(compose([f"+task={task}"]).game)
            try:
                step_ms = 1e3 * self._play(game, task, number) / _STEPS
                ratios.append(step_ms / self._workload.run_ms())
            finally:
                game.close()
        return math.fsum(ratios) / len(ratios)

    def _play(self, game: Game, task: str, number: int) -> float:
        episodes, done, seconds = Episodes(seed=self._seed + number), True, 0.0
        for step in range(_STEPS):
            if done:
                game.reset(episodes.next())
            actions = self._rude(game.actors, step, self._rng, _STEPS // 7)
            begin = time.thread_time()
            outcome = game.step(actions)
            seconds += time.thread_time() - begin
            found = list(self._inspection.step_problems(game, outcome))
            if step % _OBSERVED_EVERY == 0:
                found += self._inspection.observation_problems(game)
            self.problems += [f"round {number}, {task}, step {step}: {one}" for one in found]
            self.actions += len(actions)
            done = outcome.done
        return seconds


def sample(minutes: float, step: float, actions: int) -> Sample:
    """Return what this process and its children take now."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return Sample(
        minutes=minutes,
        memory_mb=pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
        files=len(os.listdir("/proc/self/fd")),
        processes=len(list(_children())),
        shared_mb=sum(file.stat().st_size for file in _own_shared_files()) / 1e6,
        step=step,
        actions=actions,
    )


def _children() -> Iterator[int]:
    for file in Path("/proc/self/task").glob("*/children"):
        yield from map(int, file.read_text().split())


def _own_shared_files() -> Iterator[Path]:
    """Yield files of torch and of this process in the shared memory."""
    for file in _SHARED_MEMORY.iterdir():
        if f"_{os.getpid()}_" in file.name and file.is_file():
            yield file


def play_rounds(minutes: float, seed: int) -> tuple[list[Sample], list[str]]:
    """Play rounds until the time is over; return a sample after each, and what was wrong."""
    worlds, samples = Worlds(seed), list[Sample]()
    begin = time.monotonic()
    while (time.monotonic() - begin) / 60.0 < minutes or len(samples) < 3:
        number = len(samples)
        step = worlds.round(number)
        task = veca_marl.list_tasks()[number % len(veca_marl.list_tasks())]
        try:
            with TemporaryDirectory() as folder:
                veca_marl.train(
                    task,
                    total_frames=64,
                    seed=seed + number,
                    folder=Path(folder, "run"),
                    overrides=_RUN,
                )
        except (RuntimeError, ValueError) as error:
            worlds.problems.append(f"round {number}, training {task}: {error}")
        elapsed = (time.monotonic() - begin) / 60.0
        samples.append(sample(elapsed, step, worlds.actions))
        print(samples[-1], file=sys.stderr, flush=True)
    return samples, worlds.problems


def play_actions(until: float, seed: int) -> Actions:
    """Play rounds of rude actions until a time of `time.monotonic`."""
    worlds, rounds = Worlds(seed), 0
    while time.monotonic() < until:
        worlds.round(rounds)
        rounds += 1
    return Actions(worlds.actions, worlds.problems)


def try_parsers(minutes: float) -> Parsers:
    """Run the tests of the parsers with many examples."""
    examples = round(10 + 2 * minutes)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", "-q", "tests/parsers"],
        cwd=_ROOT,
        env={**os.environ, "PARSER_EXAMPLES": str(examples)},
        capture_output=True,
        text=True,
        check=False,
    )
    # what failed, and the examples with which it did
    marks = ("FAILED", "ERROR", "E   ")
    lines = [line for line in done.stdout.splitlines() if line.startswith(marks)][:40]
    if done.returncode and not lines:
        lines = done.stdout.splitlines()[-3:]
    return Parsers(examples, done.stdout.splitlines()[-1] if done.stdout else "", lines)


def try_configurations(until: float, most: float, seed: int) -> Configurations:
    """Try random configurations until a time of `time.monotonic`, at most so many."""
    drawn = import_module("random_configurations")
    resource.setrlimit(resource.RLIMIT_AS, (_LARGEST_BYTES, _LARGEST_BYTES))
    signal.signal(signal.SIGALRM, _too_long)
    found, number = Configurations(), 1_000_000 * (seed + 1)
    while time.monotonic() < until and found.tried < most:
        rng, number = random.Random(number), number + 1
        presets = drawn.draw_presets(rng)
        words = presets + drawn.draw_changes(rng, presets)
        _try(found, words, partial(drawn.refusal, words, number))
        try:
            node = compose_node(presets)
        except ConfigError:  # presets that do not fit each other
            continue
        for _ in range(_CHANGES):
            changes = drawn.draw_changes(rng, presets)
            _try(found, presets + changes, partial(drawn.refusal_of_changes, node, changes, number))
    return found


def _try(found: Configurations, words: list[str], refusal: Callable[[], str | None]) -> None:
    """Count what becomes of a configuration."""
    print(*words, flush=True)  # the last line names what has ended this process
    signal.alarm(_CONFIGURATION_S)
    try:
        found.refused += refusal() is not None
    except Exception as error:  # whatever it is, it is reported with its configuration
        reason = " ".join(str(error).split())[:300]
        found.failed.append(f"{' '.join(words)}: {type(error).__name__}: {reason}")
    finally:
        signal.alarm(0)
    found.tried += 1


def _too_long(*_: object) -> None:
    raise TimeoutError(f"more than {_CONFIGURATION_S} s")


def _start(printed: IO[str], *words: str) -> subprocess.Popen[str]:
    """Start a part of the soak; it prints into a file, since a pipe that is full would stop it."""
    command = [sys.executable, "-m", "tools.soak", *words]
    return subprocess.Popen(command, cwd=_ROOT, stdout=printed, text=True)


def _lines(file: IO[str]) -> list[str]:
    file.seek(0)
    return file.read().splitlines()


def run(options: SoakOptions, overrides: list[str]) -> None:
    """Do what was asked for.

    Raises:
        ConfigError: If there are other overrides.
        SystemExit: With status 1, if anything grew or failed.
        WriteError: If the page cannot be written.
    """
    if overrides:
        raise ConfigError(f"{overrides[0]}: soak plays default configurations only")
    torch.set_num_threads(1)
    sys.path.insert(0, str(_HELPERS))
    if options.part == "parsers":
        print(json.dumps(asdict(try_parsers(options.minutes))))
        return
    until = time.monotonic() + 60.0 * options.minutes
    if options.part == "configurations":
        most = _CONFIGURATIONS * options.minutes
        print(json.dumps(asdict(try_configurations(until, most, options.seed))))
        return
    if options.part == "actions":
        print(json.dumps(asdict(play_actions(until, options.seed))))
        return
    file = check_file(options.to, "to")
    line = machine_line()
    parts = [*_BESIDE[:-1], *_BESIDE[-1:] * max(usable_cores() - 1, 1)]
    with ExitStack() as files:
        outputs = [files.enter_context(TemporaryFile("w+")) for _ in parts]
        beside = [
            _start(
                to, f"minutes={options.minutes}", f"seed={options.seed + number}", f"part={part}"
            )
            for number, (to, part) in enumerate(zip(outputs, parts, strict=True))
        ]
        try:
            samples, problems = play_rounds(options.minutes, options.seed)
            for process in beside:
                process.wait()
        finally:
            for process in beside:
                process.kill()
        printed = [_lines(file) for file in outputs]
    parsers, configurations, actions = Parsers(0, "", []), Configurations(), Actions()
    for part, process, lines in zip(parts, beside, printed, strict=True):
        if process.returncode:
            at = f" at: {lines[-1]}" if lines else ""
            problems.append(f"the process of the {part} {end_of(process.returncode)}{at}")
        elif part == "parsers":
            parsers = Parsers(**json.loads(lines[-1]))
        elif part == "configurations":
            configurations = Configurations(**json.loads(lines[-1]))
        else:
            more = Actions(**json.loads(lines[-1]))
            actions = Actions(actions.given + more.given, actions.problems + more.problems)
    soak = Soak(line, samples, problems, parsers, configurations, actions, options.seed)
    write_atomically(Path(file), page(soak))
    print(f"page: {file}")
    if soak.faults:
        print("\n".join(soak.faults), file=sys.stderr)
        raise SystemExit(1)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    check_imported(veca_marl.__file__)
    command = CommandLine(
        "soak", SoakOptions, str(__doc__), (WriteError,), outputs=("to",), places=("to",)
    )
    return command.run(run, words)


if __name__ == "__main__":
    sys.exit(main())
