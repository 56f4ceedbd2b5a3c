"""The command: measures rollouts and references, prints a table for each question."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch

from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.bench.learning import measure_learning
from veca_marl.bench.references import measure_references
from veca_marl.bench.rollouts import Rollouts, measure_first_world, measure_rollouts
from veca_marl.bench.tables import (
    as_json,
    learning_table,
    parts_table,
    references_table,
    task_table,
    throughput_table,
)
from veca_marl.config import ConfigError, compose, one_line
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS, Player, Task, TaskCfg, Team, find_task, terms
from veca_marl.runs.run_folder import checkout_commit
from veca_marl.sim.physics import PropCfg, PropShape
from veca_marl.sim.sound import SoundCfg, SoundKind
from veca_marl.version import __version__


@dataclass
class BenchCfg:
    """What is measured, and how often.

    Attributes:
        tasks: Tasks that are measured one after the other with their default bodies and senses, in
            one Markdown table; ``[all]`` for all tasks. Empty: the task of the command line.
        playgrounds: Playgrounds in which these tasks are measured; empty for that of each task.
        agents: Numbers of agents that move about in the playground of the task without its rules
            (free play), with its senses and bodies. Empty: the task itself is measured.
        worlds: Numbers of worlds in one environment; each is measured.
        loose_props: Balls and boxes on the floor, in free play.
        senses: Senses of the agents in free play; None takes those of the task.
        steps: Environment steps of each rollout.
        repeats: Rollouts of each kind; the tables contain medians.
        references: Whether single parts (eye, ears, skin) are measured as well.
        learning: Whether a run of the algorithm is measured beside rollouts, instead of the tables:
            the frames per second of learning as a share of cores x rollout.
        stages: Stages of that run; each takes `eval.every_frames`.
        json: File that the results are written to; None writes none.
    """

    tasks: list[str] = field(default_factory=list)
    playgrounds: list[str] = field(default_factory=list)
    agents: list[int] = field(default_factory=list)
    worlds: list[int] = field(default_factory=lambda: [1, 4])
    loose_props: int = 0
    senses: list[str] | None = None
    steps: int = 300
    repeats: int = 5
    references: bool = True
    learning: bool = False
    stages: int = 3
    json: str | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "repeats", "stages"):
            if getattr(self, name) < 1:
                raise ValueError(f"bench.{name} must be at least 1, got {getattr(self, name)}")
        for name in ("agents", "worlds"):
            if any(number < 1 for number in getattr(self, name)):
                raise ValueError(f"bench.{name} must be at least 1 each, got {getattr(self, name)}")
        if not self.worlds:
            raise ValueError("bench.worlds must contain a number of worlds")
        if self.playgrounds and not self.tasks:
            raise ValueError("bench.playgrounds needs bench.tasks; else use playground=NAME")
        if self.tasks and (self.agents or self.learning):
            raise ValueError("bench.tasks: measures neither free play nor learning")
        if self.loose_props < 0:
            raise ValueError(f"bench.loose_props must be 0 or more, got {self.loose_props}")
        if not self.agents and (self.loose_props or self.senses is not None):
            raise ValueError("bench.loose_props and bench.senses need bench.agents (free play)")
        if self.learning and self.agents:
            raise ValueError("bench.agents: free play is not learnt (bench.learning=true)")


@dataclass
class BenchOptions:
    """The options of the command, under its name."""

    bench: BenchCfg = field(default_factory=BenchCfg)


_PACKAGES = ("numpy", "numba", "torch", "torchrl", "pybullet")


def machine() -> dict[str, str | int | float | None]:
    """Return the commit, the machine and the versions of packages."""
    return {
        "veca_marl": __version__,
        "commit": checkout_commit(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
    }


def machine_line(clock: str = "processor time of one thread") -> str:
    """Return the same as text of one line, without the packages.

    Args:
        clock: What is measured.
    """
    found = machine()
    return (
        f"veca_marl {found['veca_marl']}, commit {found['commit'] or 'unknown'}; "
        f"{found['processor']}, {found['cores']} cores, load {found['load']:.1f}; "
        f"{clock}"
    )


def _processor() -> str:
    """Return the model of the processor where Linux tells it, else the architecture."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()


_BALL_RADIUS_M = 0.15


@dataclass
class FreePlayCfg(TaskCfg):
    """Parameters of free play.

    Attributes:
        loose_props: Loose balls and boxes beside the buzzing ball.
    """

    loose_props: int = 0
    weights: dict[str, float] = terms(speed=1.0)


class FreePlay(Task):
    """Agents move about in a room with one buzzing ball and loose props. Used for measuring only.

    Terms:
        speed: horizontal speed of the agent (m/s).
    """

    cfg: FreePlayCfg

    def build(self) -> None:
        """See `Task`."""
        self.room = self.world.playground.rooms[0]
        buzz = SoundCfg(kind=SoundKind.buzz, level=0.1)
        ball = PropCfg("ball", PropShape.sphere, [_BALL_RADIUS_M], mass_kg=0.3, sound=buzz)
        cfgs = [ball, *(_loose_prop(number) for number in range(self.cfg.loose_props))]
        self.loose = [self.world.add_prop(cfg) for cfg in cfgs]

    def reset(self, rng: np.random.Generator) -> None:
        """See `Task`."""
        for player in self.players:
            start = self.room.sample_floor(rng, margin_m=1.0)
            player.body.place(start, yaw_rad=rng.uniform(-math.pi, math.pi))
        for prop in self.loose:
            height = np.array([0.0, 0.0, _BALL_RADIUS_M])
            prop.place(self.room.sample_floor(rng, margin_m=1.0) + height)

    def reward(self, player: Player) -> dict[str, float]:
        """See `Task`."""
        velocity = player.body.velocity
        return {"speed": math.hypot(velocity[0], velocity[1])}


def _loose_prop(number: int) -> PropCfg:
    shape, size = (PropShape.sphere, [0.06]) if number % 2 else (PropShape.box, [0.1, 0.1, 0.1])
    return PropCfg(name=f"loose_{number}", shape=shape, size_m=size, mass_kg=0.2)


@contextmanager
def free_play(
    game: GameCfg, agents: int, loose_props: int = 0, senses: Sequence[str] | None = None
) -> Iterator[GameCfg]:
    """Register free play for the duration of a with statement.

    Args:
        game: The playground, the body, the quality of the senses and the clock.
        agents: Number of agents, all in one team.
        loose_props: Number of loose props on the floor.
        senses: Names of the senses; None takes those of the task of `game`.

    Yields:
        The configuration of a game of free play.
    """
    name = f"FreePlay{agents}"
    members = {
        "teams": (Team("agents", agents),),
        "senses": find_task(game.task.name).senses if senses is None else tuple(senses),
    }
    TASKS[name] = type(name, (FreePlay,), members)
    task = FreePlayCfg(name=name, loose_props=loose_props)
    try:
        yield replace(game, task=task, team={}, script={})
    finally:
        del TASKS[name]


_FITS_EVERYWHERE = "ObjectNav"  # what is impossible for it is no misfit of task and playground

DESCRIPTION = """
Measure agent steps per second, and the processor time of each part of a step:

    python -m veca_marl.bench +task=KickTheBall
    python -m veca_marl.bench +task=TurnBaby bench.agents=[1,2,4] bench.worlds=[1]

or one table of several tasks, ``[all]`` for all, in their own or in other playgrounds:

    python -m veca_marl.bench bench.tasks=[all]
    python -m veca_marl.bench bench.tasks=[KickTheBall,ObjectNav] bench.playgrounds=[simple,house]

or the speed of learning as a share of that of the simulator on all cores:

    python -m veca_marl.bench +task=KickTheBall bench.learning=true
    python -m veca_marl.bench +task=KickTheBall algo=sac bench.learning=true
"""


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    command = CommandLine("bench", BenchOptions, DESCRIPTION, (WriteError,), ("bench.json",))
    return command.run(bench, words)


def bench(options: BenchOptions, overrides: list[str]) -> None:
    """Measure the game that `overrides` describe, print tables and write the JSON file.

    Raises:
        ConfigError: If a choice is impossible.
    """
    if options.bench.json is not None:
        check_file(options.bench.json, "bench.json")
    if options.bench.learning:
        bench_learning(options.bench, overrides)
        return
    if options.bench.tasks:
        bench_tasks(options.bench, overrides)
        return
    cfg, game = options.bench, compose(overrides).game
    torch.set_num_threads(1)
    print(machine_line(), end="\n\n")
    try:
        with _played(game, _agents(cfg)[0], cfg) as played:
            first_world_s = measure_first_world(played)
        print(f"first world of this process: {first_world_s:.2f} s", end="\n\n")
        runs = list(_measure(game, cfg))
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    print(throughput_table(runs), end="\n\n")
    print(parts_table(runs), end="\n\n")
    references = None
    if cfg.references:
        references = measure_references(game.playground, cfg.steps, cfg.repeats)
        print(references_table(references))
    if cfg.json is not None:
        write_atomically(Path(cfg.json), as_json(machine(), first_world_s, runs, references))


def bench_tasks(cfg: BenchCfg, overrides: Sequence[str]) -> None:
    """Measure several tasks, print a Markdown table and write the JSON file.

    Raises:
        ConfigError: If a choice is impossible.
    """
    games = list(chosen_games(cfg, overrides))
    torch.set_num_threads(1)
    print(machine_line(), end="\n\n")
    try:
        first_world_s = measure_first_world(games[0])
        runs = [
            measure_rollouts(game, worlds, cfg.steps, cfg.repeats)
            for game in games
            for worlds in cfg.worlds
        ]
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    print(task_table(runs))
    if cfg.json is not None:
        write_atomically(Path(cfg.json), as_json(machine(), first_world_s, runs, None))


def chosen_games(cfg: BenchCfg, overrides: Sequence[str]) -> Iterator[GameCfg]:
    """Yield the game of each task in each playground; of ``[all]`` tasks those that fit.

    Raises:
        ConfigError: If a choice is impossible, or a task that was named does not fit.
    """
    everything = cfg.tasks == ["all"]
    places = [[f"playground={name}"] for name in cfg.playgrounds] or [[]]
    for place in places:
        compose([f"+task={_FITS_EVERYWHERE}", *place, *overrides])
    for name in sorted(TASKS) if everything else cfg.tasks:
        for number, place in enumerate(places):
            try:
                yield compose([f"+task={name}", *place, *overrides]).game
            except ConfigError as error:
                if not (everything and place):
                    raise
                print(f"left out: {name} in {cfg.playgrounds[number]}: {one_line(error)}")


def bench_learning(cfg: BenchCfg, overrides: list[str]) -> None:
    """Measure the run that `overrides` describe, print the ratio and write the JSON file.

    Raises:
        ConfigError: If a choice is impossible.
    """
    print(machine_line("elapsed time of all cores"), end="\n\n")
    learning = measure_learning(compose(overrides), cfg.steps, cfg.stages)
    print(learning_table(learning))
    if cfg.json is not None:
        content = {"machine": machine(), "learning": asdict(learning)}
        write_atomically(Path(cfg.json), json.dumps(content, indent=2) + "\n")


def _measure(game: GameCfg, cfg: BenchCfg) -> Iterator[Rollouts]:
    for agents in _agents(cfg):
        with _played(game, agents, cfg) as played:
            for worlds in cfg.worlds:
                yield measure_rollouts(played, worlds, cfg.steps, cfg.repeats)


def _agents(cfg: BenchCfg) -> list[int]:
    """Return the numbers of agents in free play; 0 stands for the task itself."""
    return cfg.agents or [0]


def _played(game: GameCfg, agents: int, cfg: BenchCfg) -> AbstractContextManager[GameCfg]:
    """Return the game itself, or free play of so many agents."""
    return free_play(game, agents, cfg.loose_props, cfg.senses) if agents else nullcontext(game)
