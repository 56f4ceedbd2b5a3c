"""The command line of the bench."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path

import torch

from veca_marl.bench.free_play import free_play
from veca_marl.bench.references import measure_references
from veca_marl.bench.report import as_json, references_table, rollouts_table
from veca_marl.bench.rollouts import Rollouts, measure_first_world, measure_rollouts
from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import TaskCfg, find_task
from veca_marl.sim.body.humanoid.humanoid import HumanoidCfg


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print a table, and write JSON if asked to; return the exit status."""
    asked = argument_parser().parse_args(arguments)
    torch.set_num_threads(1)
    try:
        game = compose(_overrides(asked)).game
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"processor time of one thread; {_load()}\n")
    with _played(game, 1, asked.things) as task:
        first_world_s = measure_first_world(replace(game, task=task))
    print(f"the first world of this process: {first_world_s:.2f} s\n")
    runs = []
    for agents in asked.agents:
        for worlds in asked.worlds:
            runs.append(_measure(game, agents, worlds, asked))
            print(rollouts_table(runs[-1]), end="\n\n")
    references = None
    if not asked.skip_references:
        references = measure_references(game.playground, asked.steps, asked.repeats)
        print(references_table(references))
    if asked.json is not None:
        asked.json.write_text(as_json(first_world_s, runs, references))
    return 0


def _measure(game: GameCfg, agents: int, worlds: int, asked: argparse.Namespace) -> Rollouts:
    with _played(game, agents, asked.things) as task:
        return measure_rollouts(replace(game, task=task), worlds, asked.steps, asked.repeats)


def _played(game: GameCfg, agents: int, things: int) -> AbstractContextManager[TaskCfg]:
    """Return the task itself for one walker, free play for more, fuller rooms and other bodies."""
    if isinstance(game.body, HumanoidCfg):
        senses = (*find_task(game.task.name).senses, "touch", "proprioception")
        return free_play(agents, game.task, senses, things)
    if agents > 1 or things:
        return free_play(agents, game.task, things=things)
    return nullcontext(game.task)


def argument_parser() -> argparse.ArgumentParser:
    """Return what understands the command line of the bench."""
    parser = argparse.ArgumentParser(
        prog="python -m veca_marl.bench",
        description="Agent steps per second, and the milliseconds of each part of a step.",
    )
    parser.add_argument("--task", default="KickTheBall", help="which game is played")
    parser.add_argument("--worlds", type=_counts, default=[1, 4], help="such as 1,4")
    parser.add_argument(
        "--agents",
        type=_counts,
        default=[1],
        help="such as 1,4; 1 plays the task, more play freely in its playground, with its senses",
    )
    parser.add_argument(
        "--body", default="walker", help="what they are; bodies with joints play freely"
    )
    parser.add_argument("--things", type=int, default=0, help="loose things in free play")
    parser.add_argument("--playground", help="where; the task's own if nothing is said")
    parser.add_argument(
        "--senses", nargs="*", default=[], metavar="SENSE=PRESET", help="such as audio=mono"
    )
    parser.add_argument("--steps", type=_count, default=300, help="steps of each rollout")
    parser.add_argument("--repeats", type=_count, default=5, help="rollouts; medians count")
    parser.add_argument("--skip-references", action="store_true", help="measure rollouts alone")
    parser.add_argument(
        "--json", type=_new_file, metavar="FILE", help="also write the numbers here"
    )
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 on")
    return int(text)


def _counts(text: str) -> list[int]:
    return [_count(part) for part in text.split(",")]


def _new_file(text: str) -> Path:
    """Refuse before measuring what could not be written after it."""
    path = Path(text)
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is not a file in a folder that exists")
    return path


def _overrides(asked: argparse.Namespace) -> list[str]:
    playground = [] if asked.playground is None else [f"playground={asked.playground}"]
    body = f"body={asked.body}"
    return [
        f"+task={asked.task}",
        body,
        *playground,
        *(f"senses/{sense}" for sense in asked.senses),
    ]


def _load() -> str:
    load, cores = os.getloadavg()[0], os.cpu_count()
    return f"{cores} cores, load {load:.1f}"
