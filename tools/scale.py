"""Measure what a frame costs, and write the page of what more cores give: docs/guides/scale.md.

It measures the parts of a step, collection by one process and by one per core, by actors of Ray
where it is installed, and learning, all in processor time; the rest of the page is arithmetic.

    python -m tools.scale to=docs/guides/scale.md
    python -m tools.scale task=TurnBaby batches=2 to=/tmp/page.md
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import torch
from tensordict import TensorDict, TensorDictBase

import veca_marl
from tools.checkout import check_imported
from tools.docs_pages.tables import table
from tools.remote_rates import processor_s
from veca_marl.algos.collection.experience import CollectCfg, Engine, Experience
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.bench.command import machine_line
from veca_marl.bench.rollouts import measure_rollouts
from veca_marl.config import Config, ConfigError, compose
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.processes.cores import usable_cores
from veca_marl.runs.assembly import GameFactory, make_learners, read_specs

_LINKS_GBPS = (1.0, 10.0)
_GROUPS = 2  # of worlds that a process plays, as in the default run on two cores
_ROLLOUT_STEPS, _ROLLOUTS = 40, 3


@dataclass
class ScaleOptions:
    """Options of the command.

    Attributes:
        to: File of the page.
        task: The task.
        batches: Batches that are measured of each kind.
        cores: Numbers of cores that are computed on paper.
    """

    to: str = "runs/scale.md"
    task: str = "KickTheBall"
    batches: int = 4
    cores: list[int] = field(default_factory=lambda: [16, 128, 1000])

    def __post_init__(self) -> None:
        if self.batches < 1:
            raise ValueError(f"batches must be at least 1, got {self.batches}")


@dataclass(frozen=True)
class Cost:
    """Cost of a frame, in milliseconds.

    Attributes:
        all_ms: Processor time of all processes.
        learner_ms: The part of it in the process that learns.
        wall_ms: Elapsed time; other programs of the machine lengthen it.
    """

    all_ms: float
    learner_ms: float
    wall_ms: float

    @property
    def worlds_ms(self) -> float:
        """Processor time in the processes with worlds."""
        return self.all_ms - self.learner_ms


@dataclass(frozen=True)
class Measured:
    """All results.

    Attributes:
        parts_ms: Processor time of each part of an agent step.
        collection: Cost of collection, by its name.
        learning: Cost of learning with one thread.
        frame_bytes: Bytes of a frame in a batch.
        policy_bytes: Bytes of the parameters that each process gets before a batch.
        cfg: The configuration.
        batches: Batches that were measured of each kind.
        machine: The machine and the commit.
    """

    parts_ms: dict[str, float]
    collection: dict[str, Cost]
    learning: Cost
    frame_bytes: float
    policy_bytes: int
    cfg: Config
    batches: int
    machine: str


def measure(options: ScaleOptions) -> Measured:
    """Measure in turn; progress is written to the standard error."""
    line = machine_line()  # first: the load of the machine is then that of other programs
    torch.set_num_threads(1)
    cfg = compose([f"+task={options.task}"])
    _say("parts of a step")
    rollouts = measure_rollouts(cfg.game, _GROUPS * cfg.collect.worlds, _ROLLOUT_STEPS, _ROLLOUTS)
    learners = make_learners(cfg, read_specs(cfg.game), torch.device("cpu"))
    policy = learners.policy.copy()
    collection, batch = {}, TensorDict()
    for name, collect in _kinds(cfg.collect).items():
        _say(name)
        with _experience(cfg, collect, learners) as experience:
            collection[name], batch = _collected(experience, options.batches)
    _say("learning")
    learning = _learnt(learners, batch, options.batches)
    return Measured(
        parts_ms=rollouts.ms_per_part,
        collection=collection,
        learning=learning,
        frame_bytes=batch.bytes() / batch.numel(),
        policy_bytes=TensorDict.from_module(policy.collect).data.bytes(),
        cfg=cfg,
        batches=options.batches,
        machine=line,
    )


def _kinds(default: CollectCfg) -> dict[str, CollectCfg]:
    """Return the ways to collect that are measured, by their names."""

    def of(processes: int, engine: Engine = Engine.processes) -> CollectCfg:
        groups = _GROUPS * max(processes, 1)
        numbers = (groups, default.worlds, default.steps)
        return CollectCfg(*numbers, processes=processes, engine=engine)

    cores = usable_cores()
    kinds = {"the learner's process": of(0), "1 worker process": of(1)}
    if cores > 1:
        kinds[f"{cores} worker processes"] = of(cores)
    if find_spec("ray") is not None:
        kinds[f"{cores} actors of Ray"] = of(cores, Engine.ray)
    return kinds


@contextmanager
def _experience(cfg: Config, collect: CollectCfg, learners: TeamLearners) -> Iterator[Experience]:
    experience = Experience(GameFactory(cfg.game), learners.policy.copy().collect, collect)
    try:
        experience.restart(0)
        yield experience
    finally:
        experience.close()


def _collected(experience: Experience, batches: int) -> tuple[Cost, TensorDictBase]:
    """Return the cost of a frame, new parameters before each batch included, and a batch."""
    experience.collect()  # fills caches

    def collect() -> TensorDictBase:
        experience.update_policy()
        return experience.collect()

    return _cost(collect, batches, experience.cfg.frames), experience.collect().clone()


def _learnt(learners: TeamLearners, batch: TensorDictBase, batches: int) -> Cost:
    learners.learn(batch.clone())  # fills caches
    cost = _cost(lambda: learners.learn(batch.clone()), batches, batch.numel())
    return Cost(cost.learner_ms, cost.learner_ms, cost.wall_ms)  # no other process takes part


def _cost(action: Callable[[], object], times: int, frames: int) -> Cost:
    before = processor_s(), time.process_time(), time.perf_counter()
    for _ in range(times):
        action()
    after = processor_s(), time.process_time(), time.perf_counter()
    per_frame = 1e3 / (times * frames)
    return Cost(*(per_frame * (b - a) for a, b in zip(before, after, strict=True)))


def _say(what: str) -> None:
    print(f"measuring {what} ...", file=sys.stderr, flush=True)


_PAGE = """# How large?

<!-- generated by `python -m tools.scale to=docs/guides/scale.md`: edit tools/scale.py -->

What a frame of {task} costs, what two cores make of it, and what 16 or 1000 would. Measured in
processor time with the default senses, network and batch (`collect=workers32`, PPO), means of
{batches} batches. A frame is one step of one world. What is computed from these figures, not
measured, is called *on paper*.

Machine: {machine}.

## Cost of a frame

Parts of an agent step, {worlds} worlds in one process, random actions:

{parts}

Collection with the network that acts, new parameters before each batch, and learning:

{costs}

In the column *in the learner's process* is the work that more cores do not divide: to receive a
batch and put it together, and to learn from it. Elapsed times are those of a machine with this
load by other programs; processor times depend on it less, by a quarter between runs.

## Traffic of a frame

| what | bytes |
|---|---|
| a frame of a batch, worlds to learner | {frame_bytes:,.0f} |
| parameters, learner to each process, for each batch | {policy_bytes:,} |
| both for each frame, at {frames_each} frames of each process in a batch | {traffic:,.0f} |

A frame of a batch has the observations before and after the step. Worker processes of one machine
write batches into memory that they share with the learner. Actors of Ray copy them: into the memory
of their node, over the network, and into that of the learner.

## What cores give

On paper: collection takes the processor time of the processes with worlds, divided by the cores,
then the learner receives the batch, then it learns, one after the other. *Learner on 2 cores*
divides the measured time of learning by 2; *learner free* takes it as 0, what a fast GPU comes near
to. The number of processes is the number of cores; up to the cores of one machine they are worker
processes, in the rows of more than 128 cores actors of Ray. Processes of one machine share caches
and memory, which is not in these figures.

{cores}

*One batch* is what the learner has to hold when every process plays {worlds} worlds for {steps}
steps; with fewer steps for each, parameters are sent more often.

## What stops it

{stops}
"""


def page(measured: Measured, cores: Sequence[int]) -> str:
    """Return the text of the page."""
    collect = measured.cfg.collect
    frames_each = _GROUPS * collect.worlds * collect.steps
    traffic = measured.frame_bytes + measured.policy_bytes / frames_each
    total = math.fsum(measured.parts_ms.values())
    return _PAGE.format(
        task=measured.cfg.task.name,
        batches=measured.batches,
        machine=measured.machine,
        worlds=_GROUPS * collect.worlds,
        steps=collect.steps,
        parts="\n".join(
            table(
                ("part", "ms", "of the step"),
                [
                    (part, f"{ms:.3f}", f"{ms / total:.0%}")
                    for part, ms in sorted(measured.parts_ms.items(), key=lambda one: -one[1])
                ]
                + [("all", f"{total:.3f}", "100%")],
            )
        ),
        costs="\n".join(_cost_table(measured)),
        frame_bytes=measured.frame_bytes,
        policy_bytes=measured.policy_bytes,
        frames_each=frames_each,
        traffic=traffic,
        cores="\n".join(_cores_table(measured, (2, *cores))),
        stops="\n".join(_stops(measured, traffic)),
    )


def _cost_table(measured: Measured) -> list[str]:
    rows = {f"collection by {k}": v for k, v in measured.collection.items()}
    rows["learning, one thread"] = measured.learning
    return table(
        ("", "all processes, ms", "in the learner's process, ms", "elapsed, ms"),
        [
            (name, f"{cost.all_ms:.3f}", f"{cost.learner_ms:.3f}", f"{cost.wall_ms:.3f}")
            for name, cost in rows.items()
        ],
    )


@dataclass(frozen=True)
class OnPaper:
    """What a number of cores gives.

    Attributes:
        collected: Frames per second while worlds are stepped and received.
        learnt: Frames per second with a learner on 2 cores.
        free: Frames per second with a learner whose time is 0.
    """

    collected: float
    learnt: float
    free: float


def on_paper(worlds_ms: float, receive_ms: float, learn_ms: float, cores: int) -> OnPaper:
    """Return the rates of collection and learning that take turns.

    Args:
        worlds_ms: Processor time of a frame in the processes with worlds.
        receive_ms: Time of the learner to receive a frame.
        learn_ms: Time of one thread to learn from a frame.
        cores: Cores, each with one process.
    """
    collect = worlds_ms / cores + receive_ms
    return OnPaper(1e3 / collect, 1e3 / (collect + learn_ms / 2), 1e3 / collect)


_ONE_MACHINE = 128


def _costs(measured: Measured, cores: int) -> Cost:
    """Return the cost of collection by that many cores."""
    kinds = list(measured.collection.values())
    by_ray = [cost for name, cost in measured.collection.items() if name.endswith("of Ray")]
    if cores > _ONE_MACHINE and by_ray:
        return by_ray[0]
    return kinds[-1 - len(by_ray)]


def _cores_table(measured: Measured, cores: Sequence[int]) -> list[str]:
    collect = measured.cfg.collect
    rows = []
    for number in cores:
        cost = _costs(measured, number)
        rates = on_paper(cost.worlds_ms, cost.learner_ms, measured.learning.all_ms, number)
        batch = number * _GROUPS * collect.worlds * collect.steps
        rows.append(
            (
                f"{number}",
                f"{number / cost.worlds_ms * 1e3:,.0f}",
                f"{rates.learnt:,.0f}",
                f"{rates.free:,.0f}",
                f"{rates.free * measured.frame_bytes / 1e6:,.0f} MB/s",
                f"{batch * measured.frame_bytes / 1e9:,.2f} GB",
            )
        )
    head = ("cores", "worlds only", "learner on 2 cores", "learner free", "traffic", "one batch")
    return table([head[0], *(f"{name}, frames/s" for name in head[1:4]), *head[4:]], rows)


def _stops(measured: Measured, traffic: float) -> list[str]:
    """Return what limits a run, with the number of cores from which it does."""
    ray = _costs(measured, _ONE_MACHINE + 1)
    local = _costs(measured, _ONE_MACHINE)
    learn = measured.learning.all_ms
    return [
        f"1. **The learner.** Learning takes {learn:.2f} ms of one thread for each frame, the "
        f"worlds {local.worlds_ms:.2f} ms: with a learner on 2 cores no number of cores for worlds "
        f"gives more than {1e3 / (learn / 2 + local.learner_ms):,.0f} frames/s, and half of that "
        f"is reached at {math.ceil(local.worlds_ms / (learn / 2 + local.learner_ms))} cores. A GPU "
        "moves this limit; several GPUs for one learner are out of scope.",
        f"2. **One process receives.** {local.learner_ms:.3f} ms for each frame from worker "
        f"processes, {ray.learner_ms:.3f} ms from actors of Ray, limit collection to "
        f"{1e3 / local.learner_ms:,.0f} and {1e3 / ray.learner_ms:,.0f} frames/s: the cores wait "
        f"half of the time from {math.ceil(local.worlds_ms / local.learner_ms)} and "
        f"{math.ceil(ray.worlds_ms / ray.learner_ms)} on.",
        "3. **The network.** "
        + "; ".join(
            f"{gbps:g} Gbit/s carry {gbps * 1e9 / 8 / traffic:,.0f} frames/s, those of "
            f"{math.ceil(gbps * 1e9 / 8 / traffic * ray.worlds_ms / 1e3)} cores"
            for gbps in _LINKS_GBPS
        )
        + ". Most of a frame are images: without vision it is a fraction of it.",
        "4. **The batch.** Collection is synchronous: every process plays equally many steps, "
        "and the slowest of them is waited for. More processes make larger batches, from which the "
        "algorithm takes as many gradient steps as from smaller ones unless its numbers change.",
        "",
        "So one run is best on the cores of one machine, and more machines are best used by more "
        "runs: seeds, arms and tasks as [sweeps](clusters.md#launchers), which share nothing.",
    ]


def run(options: ScaleOptions, overrides: list[str]) -> None:
    """Measure and write the page.

    Raises:
        ConfigError: If there are other overrides.
        WriteError: If the page cannot be written.
    """
    if overrides:
        raise ConfigError(f"{overrides[0]}: scale measures default configurations only")
    file = check_file(options.to, "to")
    write_atomically(Path(file), page(measure(options), options.cores))
    print(f"page: {file}")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    check_imported(veca_marl.__file__)
    command = CommandLine(
        "scale", ScaleOptions, str(__doc__), (WriteError,), outputs=("to",), places=("to",)
    )
    return command.run(run, words)


if __name__ == "__main__":
    sys.exit(main())
