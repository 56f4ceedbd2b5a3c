"""Let what a run learnt play again, also elsewhere: ``python -m veca_marl.evaluate runs/...``.

Choices after the run's folder change the game: ``senses/audio=mono``, ``opponent.defender=expert``,
``task.starts={on_back:1}``. What was learnt must still fit: the same senses in the same shapes, the
same actions. Choices that the run left open are as the defaults are today.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import torch
from tensordict.nn import TensorDictSequential

from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.checkpoint import CheckpointError
from veca_marl.algos.training.comparison import interval
from veca_marl.algos.training.evaluation import (
    Exploration,
    RandomTeams,
    Scores,
    evaluate,
)
from veca_marl.algos.training.stored import load_actor
from veca_marl.config import Config, ConfigError, compose, one_line
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.assembly import make_env
from veca_marl.runs.run_folder import open_run

_LEARNING = ("self_play", "warm_start", "learner", "algo@learner")

Table = dict[str, dict[str, Scores]]


def play_again(
    learnt: Path, overrides: Sequence[str], episodes: int, exploration: Exploration, seed: int
) -> Table:
    """Return the scores of each team of the policy, and of a random one in the same episodes.

    Args:
        learnt: The folder of a run (its latest checkpoint counts), or one of its checkpoints.
        overrides: What is other than in the run, as on its command line.
        episodes: How many.
        exploration: Whether the policy takes its most likely actions or draws them.
        seed: Of the episodes.

    Raises:
        ConfigError: If there is no run, or a choice is impossible.
        CheckpointError: If what was learnt does not fit.
    """
    folder = open_run(learnt.parent.parent if learnt.is_file() else learnt)
    cfg = compose([*_about_the_game(folder.overrides), *overrides])
    env = _worlds(cfg, episodes, seed)
    specs = team_specs(env)
    actors = {
        team: load_actor(cfg.frozen.get(team, learnt), team, spec) for team, spec in specs.items()
    }
    baseline = RandomTeams(
        env, [team for team in actors if team not in cfg.frozen], [actors[t] for t in cfg.frozen]
    )
    policy = TensorDictSequential(*actors.values())
    table = {
        "policy": evaluate(env, policy, episodes, seed, exploration),
        "random": evaluate(env, baseline, episodes, seed, exploration),
    }
    env.close()
    return table


def _about_the_game(overrides: Sequence[str]) -> list[str]:
    """Leave out how single teams learnt: they may be opponents now, who must not be told."""
    return [text for text in overrides if not text.lstrip("+~").startswith(_LEARNING)]


def _worlds(cfg: Config, episodes: int, seed: int) -> VecaEnv:
    try:
        return make_env(cfg.game, min(episodes, cfg.eval.worlds), seed)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def summary(table: Table) -> list[dict[str, object]]:
    """Return a row for each player and team: means over the episodes, the return's interval."""
    return [
        {
            "player": player,
            "team": team,
            "episodes": len(scores.returns),
            "return": float(scores.returns.mean()),
            "interval": interval(scores.returns),
            "length": float(scores.lengths.mean()),
            **{name: float(values.mean()) for name, values in scores.terms.items()},
        }
        for player, teams in table.items()
        for team, scores in teams.items()
    ]


def lines(rows: list[dict[str, object]]) -> list[str]:
    """Return the rows as a table to read."""
    cells = [[f"{v:.3f}" if isinstance(v, float) else _short(v) for v in r.values()] for r in rows]
    table = [list(rows[0]), *cells]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    ]


def _short(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{value[0]:.3f}, {value[1]:.3f}]"
    return str(value)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m veca_marl.evaluate", description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a run, or a checkpoint in it")
    parser.add_argument("override", nargs="*", help="what is other than in the run")
    parser.add_argument("--episodes", type=int, default=32)
    parser.add_argument("--seed", type=int, default=1, help="of the episodes")
    parser.add_argument("--draw", action="store_true", help="draw actions instead of the likeliest")
    parser.add_argument("--json", type=Path, help="also write the table there")
    asked = parser.parse_args(arguments)
    if asked.episodes < 1 or asked.seed < 0:
        parser.error("--episodes must be at least 1, --seed at least 0")
    torch.set_num_threads(1)
    how = Exploration.stochastic if asked.draw else Exploration.deterministic
    try:
        table = play_again(asked.run, asked.override, asked.episodes, how, asked.seed)
    except (ConfigError, CheckpointError) as error:
        print(f"error: {one_line(error)}", file=sys.stderr)
        return 2
    rows = summary(table)
    print(*lines(rows), sep="\n")
    if asked.json is not None:
        asked.json.write_text(json.dumps(rows, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
