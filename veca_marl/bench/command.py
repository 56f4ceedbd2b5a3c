"""The command: measures rollouts and references, prints a table for each question."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from pathlib import Path

import torch

from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.bench.free_play import free_play
from veca_marl.bench.learning import measure_learning
from veca_marl.bench.machine import machine, machine_line
from veca_marl.bench.options import BenchCfg, BenchOptions
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
from veca_marl.config.command_line import CommandLine
from veca_marl.config.outputs import check_file
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TASKS

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
