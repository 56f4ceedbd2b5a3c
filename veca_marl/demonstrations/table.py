"""What can be learnt from demonstrations: expert, imitation and random policy, on frozen episodes.

Everything is kept in one folder, and what is there is not done again: recordings, runs, and the
scores of each policy on the first frozen episodes of its task.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from omegaconf import MISSING
from torch import nn

from veca_marl import api
from veca_marl.algos.evaluation.comparison import interval
from veca_marl.algos.evaluation.evaluate import Exploration, RandomTeams, Scores, evaluate
from veca_marl.algos.files import write_atomically
from veca_marl.algos.specs import team_specs
from veca_marl.config import Config, ConfigError, compose, one_line
from veca_marl.config.command_line import check_folder
from veca_marl.demonstrations.episode_files import Archive
from veca_marl.demonstrations.record import Recording, make_card, record
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.benchmark import EPISODES, find_benchmark
from veca_marl.play.session import InTurn
from veca_marl.processes.cores import usable_cores
from veca_marl.runs.continuation import read_progress
from veca_marl.runs.lock import locked
from veca_marl.runs.run_folder import provenance, stored_actors
from veca_marl.stored_files import read_json

EXPERT, RANDOM = "expert", "random"
_WORLDS = 8
_CHOICES = "choices.json"


@dataclass
class TableOptions:
    """Options of ``table``.

    Attributes:
        tasks: Names of the tasks.
        to: Folder in which recordings, runs and scores are kept.
        algos: Presets of algorithms that learn from the demonstrations.
        episodes: Demonstrated episodes of each task.
        frozen: How many of the frozen episodes of each task every policy plays, the first ones.
        seed: Seed of demonstrations and runs.
        processes: Processes that record; None is one for each core.
    """

    tasks: list[str] = MISSING
    to: str = "runs/imitation"
    algos: list[str] = field(default_factory=lambda: ["bc"])
    episodes: int = 500
    frozen: int = EPISODES
    seed: int = 0
    processes: int | None = None

    def __post_init__(self) -> None:
        if not 2 <= self.frozen <= EPISODES:
            raise ValueError(f"frozen must be from 2 to {EPISODES}, got {self.frozen}")
        if self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        for name in ("seed", "processes"):
            if (getattr(self, name) or 0) < 0:
                raise ValueError(f"{name} must be 0 or more, got {getattr(self, name)}")


Row = dict[str, dict[str, Any]]
"""Team to its scores (mean return, its interval, fraction solved)."""


def make_table(options: TableOptions, overrides: Sequence[str]) -> str:
    """Record, learn and play what is missing; return the table and write it into the folder.

    Args:
        options: What is compared.
        overrides: Changes of the configuration of all runs, such as ``total_frames=1e6``.

    Raises:
        ConfigError: If a choice is impossible, a run in the folder is not complete, or the folder
            holds results of other choices.
    """
    folder = check_folder(options.to, "to")
    scores = {task: _scores(options, folder, task, overrides) for task in options.tasks}
    table = markdown(scores, options)
    write_atomically(folder / "table.md", table)
    return table


def _scores(
    options: TableOptions, folder: Path, task: str, overrides: Sequence[str]
) -> dict[str, Row]:
    """Return the scores of each player of a task."""
    cfg = compose([f"+task={task}", *overrides])
    _check_frozen(cfg)
    _check_choices(folder / task / _CHOICES, options, overrides)
    found = {}
    for player, prepare in _players(options, folder / task, cfg, overrides):
        file = folder / task / f"scores_{player}_{options.frozen}.json"
        if not file.exists():
            row = _played(cfg, prepare(), options.frozen)
            write_atomically(file, json.dumps(row, indent=1) + "\n")
        found[player] = read_json(file)
    return found


def _check_choices(path: Path, options: TableOptions, overrides: Sequence[str]) -> None:
    """Store the choices that all scores of a task depend on; refuse others than those stored."""
    now = {"episodes": options.episodes, "seed": options.seed, "overrides": list(overrides)}
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(now, indent=1) + "\n")
        return
    before = read_json(path)
    if differing := [name for name in now if before.get(name) != now[name]]:
        texts = [f"{name}={before.get(name)!r:.400}, not {now[name]!r:.400}" for name in differing]
        raise ConfigError(
            f"{path.parent} holds results of {'; '.join(texts)}: choose another folder by to="
        )


def _check_frozen(cfg: Config) -> None:
    try:
        find_benchmark(cfg.task.name).check_parameters(cfg.task)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def _recorded(options: TableOptions, folder: Path, cfg: Config, overrides: Sequence[str]) -> Path:
    """Return a folder with demonstrations, which are recorded if they are missing."""
    recording = Recording(cfg.game, options.episodes, options.seed, tuple(cfg.plugins))
    words = [f"+task={cfg.task.name}", *overrides]
    with locked(folder):
        archive = Archive(folder, make_card(recording, provenance(words)))
        archive.begin()
        processes = usable_cores() if options.processes is None else options.processes
        record(recording, archive, processes)
    return folder


Policy = Callable[[VecaEnv], nn.Module]
"""Makes a policy for an environment."""


def _players(
    options: TableOptions, folder: Path, cfg: Config, overrides: Sequence[str]
) -> Iterator[tuple[str, Callable[[], Policy]]]:
    """Yield the name of each player, and what makes it: with what it learns from, if it is missing.

    What has its scores already is not made: recordings and runs may be elsewhere by then.
    """
    yield EXPERT, lambda: ExpertPolicy
    for algo in options.algos:

        def learnt(algo: str = algo) -> Policy:
            run = _learnt(options, folder, algo, cfg, overrides)
            return lambda env: InTurn(list(stored_actors(cfg, run, team_specs(env)).values()))

        yield algo, learnt
    yield RANDOM, lambda: lambda env: RandomTeams(env, list(env.group_map))


def _learnt(
    options: TableOptions, folder: Path, algo: str, cfg: Config, overrides: Sequence[str]
) -> Path:
    """Return the folder of a run that has learnt from demonstrations, which is trained if needed.

    Raises:
        ConfigError: If it was interrupted.
    """
    run = folder / algo
    progress = read_progress(run)
    if progress is None:
        demonstrations = _recorded(options, folder / "demonstrations", cfg, overrides)
        words = [f"algo={algo}", f"demonstrations={demonstrations}", "log.video=false"]
        api.train(cfg.task.name, seed=options.seed, folder=run, overrides=[*words, *overrides])
    elif not progress.ended:
        raise ConfigError(
            f"{run} is not complete: python -m veca_marl.train resume={run} continues it"
        )
    return run


def _played(cfg: Config, make: Policy, episodes: int) -> Row:
    """Play the first frozen episodes and return the scores."""
    seed = find_benchmark(cfg.task.name).seed
    torch.set_num_threads(1)
    with closing(VecaEnv(cfg.game, min(_WORLDS, episodes), seed)) as env:
        scores = evaluate(env, make(env), episodes, seed, Exploration.deterministic)
    return {team: _row(one) for team, one in scores.items()}


def _row(scores: Scores) -> dict[str, Any]:
    solved = {} if scores.solved is None else {"solved": float(scores.solved.mean())}
    return {
        "return": float(scores.returns.mean()),
        "interval": [float(bound) for bound in interval(scores.returns)],
        "episodes": len(scores.returns),
        **solved,
    }


def markdown(scores: Mapping[str, Mapping[str, Row]], options: TableOptions) -> str:
    """Return the table: a row for each task and team, a column for each player."""
    names = {algo: f"{algo}, {options.episodes} episodes" for algo in options.algos}
    players = [EXPERT, *options.algos, RANDOM]
    lines = [
        f"Mean return on the first {options.frozen} frozen episodes, its 95 % interval, and the "
        "fraction of the episodes that ended solved.",
        "",
        "| task | team | " + " | ".join(names.get(player, player) for player in players) + " |",
        "|---|---|" + "---|" * len(players),
    ]
    for task, row in scores.items():
        for team in row[EXPERT]:
            cells = " | ".join(_cell(row[player][team]) for player in players)
            lines.append(f"| {task} | {team} | {cells} |")
    return "\n".join(lines) + "\n"


def _cell(score: Mapping[str, Any]) -> str:
    low, high = score["interval"]
    solved = f", {score['solved']:.0%}" if "solved" in score else ""
    return f"{score['return']:.2f} [{low:.2f}, {high:.2f}]{solved}"
