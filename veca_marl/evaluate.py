"""Score what a run has learnt: ``python -m veca_marl.evaluate run=runs/...``.

The episodes are played on the configuration stored with the run. Other overrides change it:
``senses/audio=mono``, ``opponent.defender=expert``, ``task.max_seconds=30``. The policies must fit:
the same senses in the same shapes, the same actions. In the same episodes each team that learnt
acts at random against the same opponents: the policies of the other teams. ``episodes=benchmark``
plays the frozen episodes of the task and prints in what the game differs from the default one of
the task.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import torch
from tensordict.nn import TensorDictSequential
from torch import nn
from tqdm import tqdm

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.evaluation.comparison import comparison_line, interval, solved_rate
from veca_marl.algos.evaluation.evaluate import Exploration, RandomTeams, Scores, evaluate
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.algos.specs import team_specs
from veca_marl.config import Config, ConfigError, compose, one_line
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.benchmark import Benchmark, find_benchmark, parameters
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.policy_paths import policy_path
from veca_marl.runs.run_folder import stored_actors, stored_configuration
from veca_marl.sweeps.differences import differences

_ERRORS = (CheckpointError, WriteError)
Table = dict[str, dict[str, Scores]]
"""Scores by player (policy, random) and team."""
BENCHMARK = "benchmark"
"""Value of ``episodes`` for the frozen episodes of the task."""


@dataclass
class EvaluateCfg:
    """How the episodes are played.

    Attributes:
        exploration: Whether policies take the mode of their distribution or a sample; None is as in
            the run (`eval.exploration`).
        json: File that the table is written to; None writes none.
    """

    exploration: Exploration | None = None
    json: str | None = None


@dataclass
class EvaluateOptions:
    """Options of the command.

    Attributes:
        run: Folder of a run (its latest checkpoint is used), a checkpoint in it, or zoo/NAME.
        policy: Another name for `run`, as `play` has it.
        episodes: Number of episodes, or ``benchmark`` for the frozen episodes of the task; the
            parameters of the task and all starts must be those of the benchmark.
        seed: Seed of the episodes; None is 1, or that of the benchmark.
        evaluate: How they are played.
    """

    run: str | None = None
    policy: str | None = None
    episodes: int | str = 32
    seed: int | None = None
    evaluate: EvaluateCfg = field(default_factory=EvaluateCfg)

    def __post_init__(self) -> None:
        if self.run is not None and self.policy is not None:
            raise ValueError(f"run={self.run} and policy={self.policy} are the same option")
        if isinstance(self.episodes, str):
            self._check_benchmark()
        elif self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        if self.seed is not None and self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")

    def path(self) -> Path:
        """Return what is evaluated.

        Raises:
            ConfigError: If none is named, or there is no such policy in the zoo.
        """
        named = self.run or self.policy
        if named is None:
            raise ConfigError("evaluate needs run=VALUE: a run, a checkpoint, or zoo/NAME")
        try:
            return policy_path(named)
        except ValueError as error:
            raise ConfigError(f"run={named}: {error}") from error

    def _check_benchmark(self) -> None:
        if self.episodes != BENCHMARK:
            raise ValueError(f"episodes must be a number or {BENCHMARK!r}, got {self.episodes!r}")
        if self.seed is not None:
            raise ValueError(f"seed={self.seed}: the benchmark has a seed of its own")


@dataclass(frozen=True)
class Evaluated:
    """Scores, and the episodes that they belong to.

    Attributes:
        table: The scores.
        benchmark: The frozen episodes that were played; None for others.
        game: The game that was played.
    """

    table: Table
    benchmark: Benchmark | None
    game: GameCfg


def evaluate_run(options: EvaluateOptions, overrides: Sequence[str] = ()) -> Evaluated:
    """Return the scores of each team by its policy, and by a random one in the same episodes.

    Of teams that did not learn in the run, which are its opponents, there is no random one.

    Args:
        options: The run and the episodes.
        overrides: Changes of the stored configuration.

    Raises:
        ConfigError: If there is no run, a choice is impossible, or the starts are not those of the
            benchmark.
        CheckpointError: If the policies do not fit.
    """
    checkpoint = options.path()
    cfg = stored_configuration(checkpoint, overrides, "run=")
    exploration = options.evaluate.exploration or cfg.eval.exploration
    benchmark = _checked_benchmark(cfg) if options.episodes == BENCHMARK else None
    episodes, seed = _episodes(options, benchmark)
    env = _make_env(cfg, episodes, seed)
    actors = stored_actors(cfg, checkpoint, team_specs(env))
    learnt = [team for team in actors if team not in cfg.frozen]
    total = episodes * (1 + len(learnt))
    with closing(env), tqdm(total=total, unit="episode", disable=None) as bar:

        def play(policy: nn.Module) -> dict[str, Scores]:
            return evaluate(env, policy, episodes, seed, exploration, played=bar.update)

        table = {
            "policy": play(TensorDictSequential(*actors.values())),
            "random": {
                team: play(RandomTeams(env, [team], _others(actors, team)))[team] for team in learnt
            },
        }
    return Evaluated(table, benchmark, cfg.game)


def _others(actors: Mapping[str, nn.Module], team: str) -> list[nn.Module]:
    return [actor for name, actor in actors.items() if name != team]


def _checked_benchmark(cfg: Config) -> Benchmark:
    try:
        benchmark = find_benchmark(cfg.task.name)
        benchmark.check(cfg.game)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    return benchmark


def departures(game: GameCfg) -> str:
    """Return in words in what a game differs from the default one of its task.

    Frozen episodes fix the task and its starts. Clock, body, senses and opponents are free, but
    returns with different ones cannot be compared.
    """
    default = compose([f"+task={game.task.name}"]).game
    changed = differences(parameters(default), parameters(game))
    if not changed:
        return "the game is the default one of the task"
    return "other than in the default game: " + ", ".join(
        f"{one.key}={one.asked} ({one.stored})" for one in changed
    )


def _episodes(options: EvaluateOptions, benchmark: Benchmark | None) -> tuple[int, int]:
    """Return the number of the episodes and their seed."""
    if benchmark is not None:
        return len(benchmark.starts), benchmark.seed
    return int(options.episodes), 1 if options.seed is None else options.seed


def _make_env(cfg: Config, episodes: int, seed: int) -> VecaEnv:
    try:
        return VecaEnv(cfg.game, min(episodes, cfg.eval.worlds), seed)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def summary(table: Table) -> list[dict[str, object]]:
    """Return a row for each player and team: means over the episodes, the return's interval.

    In a task with a goal, ``solved`` is the share of the episodes that ended with the goal reached.
    One episode has no interval: None.
    """
    return [
        {
            "player": player,
            "team": team,
            "episodes": len(scores.returns),
            "return": float(scores.returns.mean()),
            "interval": interval(scores.returns) if len(scores.returns) > 1 else None,
            "length": float(scores.lengths.mean()),
            **solved_rate(scores),
            **{n: float(values.mean()) for n, values in (scores.each | scores.terms).items()},
        }
        for player, teams in table.items()
        for team, scores in teams.items()
    ]


def lines(rows: Sequence[dict[str, object]]) -> list[str]:
    """Return the rows as an aligned table; a term that a team does not have is empty."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    table = [columns, *([_cell(row.get(name, "")) for name in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(map(str.ljust, line, widths)).rstrip() for line in table]


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return f"[{value[0]:.3f}, {value[1]:.3f}]"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def run(options: EvaluateOptions, overrides: list[str]) -> None:
    """Evaluate, print the table and the paired comparison, write the JSON file."""
    torch.set_num_threads(1)
    file = options.evaluate.json
    json_file = None if file is None else check_file(file, "evaluate.json")
    evaluated = evaluate_run(options, overrides)
    table, rows = evaluated.table, summary(evaluated.table)
    if evaluated.benchmark is not None:
        print(evaluated.benchmark)
        print(departures(evaluated.game))
        rows = [{**row, BENCHMARK: evaluated.benchmark.version} for row in rows]
    print(*lines(rows), sep="\n")
    for team, scores in table["random"].items():
        print(comparison_line(team, table["policy"][team], scores))
    if json_file is not None:
        write_atomically(json_file, json.dumps(rows, indent=2) + "\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    description = str(__doc__)
    return CommandLine(
        "evaluate", EvaluateOptions, description, _ERRORS, outputs=("evaluate.json",)
    ).run(run, words)


if __name__ == "__main__":
    sys.exit(main())
