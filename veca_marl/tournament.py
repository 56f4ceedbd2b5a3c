"""Let the past selves of a self-play run meet: ``python -m veca_marl.tournament runs/...``.

Writes ``cross_play.csv`` (every match), ``elo.csv`` (every player's rating) and, with the extra
``[plot]``, ``cross_play.png`` (the matrix of points) into the folder of the run.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from veca_marl.algos.selfplay.pool import Pool
from veca_marl.algos.selfplay.tournament import Match, Rating, play_all, rate, table_of_points
from veca_marl.algos.training.checkpoint import CheckpointError
from veca_marl.config import Config, ConfigError, one_line, to_config
from veca_marl.runs.assembly import make_env, make_learners, read_specs
from veca_marl.runs.run_folder import RunFolder, open_run


def tournament(folder: RunFolder, members: int, episodes: int, draw_margin: float) -> list[Match]:
    """Play the tournament of a run.

    Args:
        folder: The run.
        members: How many past selves of each team, spread evenly over the run.
        episodes: Of each match.
        draw_margin: Returns nearer to each other than this are a draw.

    Raises:
        ConfigError: If it was no self-play run, or there are fewer than two past selves.
    """
    cfg = to_config(folder.typed_config())
    pool = Pool(folder.pool)
    chosen = {team: spread(pool.members(team), members) for team in cfg.self_play.teams}
    if not chosen or min(len(frames) for frames in chosen.values()) < 2:
        raise ConfigError(f"{folder.path}: no past selves in it; was it run with self_play.teams?")
    return _play(cfg, pool, chosen, episodes, draw_margin)


def _play(
    cfg: Config, pool: Pool, chosen: dict[str, list[int]], episodes: int, draw_margin: float
) -> list[Match]:
    learners = make_learners(cfg, read_specs(cfg.game), torch.device("cpu"))
    env = make_env(cfg.game, min(episodes, cfg.eval.worlds), cfg.seed)
    matches = play_all(env, learners.policy, pool, chosen, episodes, draw_margin, cfg.seed)
    env.close()
    return matches


def spread(frames: Sequence[int], count: int) -> list[int]:
    """Return `count` of the numbers, the first and the last among them, evenly between."""
    if len(frames) <= count:
        return list(frames)
    return [frames[i] for i in np.linspace(0, len(frames) - 1, count).round().astype(int)]


def write_results(path: Path, matches: list[Match], ratings: list[Rating]) -> None:
    """Write the matches and the ratings as CSV into a folder."""
    first, second = matches[0].members
    with (path / "cross_play.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        columns = [f"{first}_frames", f"{second}_frames", "episodes"]
        writer.writerow([*columns, f"{first}_wins", f"{second}_wins", "ahead"])
        for m in matches:
            writer.writerow([*m.members.values(), m.episodes, *m.wins.values(), f"{m.ahead:.6g}"])
    with (path / "elo.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["team", "frames", "elo"])
        writer.writerows([r.team, r.frames, f"{r.elo:.1f}"] for r in ratings)


def draw_matrix(path: Path, matches: list[Match]) -> None:
    """Draw the first team's points as a PNG file.

    Raises:
        ModuleNotFoundError: Without the extra ``[plot]``.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "the picture needs matplotlib: pip install 'veca_marl[plot]'", name=error.name
        ) from error
    first, second = matches[0].members
    figure = Figure(figsize=(5.5, 4.5), layout="constrained")
    axes = figure.subplots()
    table = table_of_points(matches)
    image = axes.imshow(table, vmin=0.0, vmax=1.0, cmap="RdBu", origin="lower")
    for (row, column), points in np.ndenumerate(table):
        axes.text(column, row, f"{points:.2f}", ha="center", va="center")
    for axis, team in ((axes.yaxis, first), (axes.xaxis, second)):
        frames = sorted({match.members[team] for match in matches})
        axis.set_ticks(range(len(frames)), [f"{n / 1000:.0f}k" for n in frames])
    axes.set(xlabel=f"{second} after so many frames", ylabel=f"{first} after so many frames")
    figure.colorbar(image, label=f"points of {first} (win 1, draw 1/2)")
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m veca_marl.tournament", description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a self-play run")
    parser.add_argument("--members", type=int, default=6, help="past selves of each team")
    parser.add_argument("--episodes", type=int, default=16, help="episodes of each match")
    parser.add_argument("--draw-margin", type=float, default=0.5, help="difference of a draw")
    asked = parser.parse_args(arguments)
    if min(asked.members, asked.episodes) < 1:
        parser.error("--members and --episodes must be at least 1")
    try:
        folder = open_run(asked.run)
        matches = tournament(folder, asked.members, asked.episodes, asked.draw_margin)
    except (ConfigError, CheckpointError) as error:
        print(f"error: {one_line(error)}", file=sys.stderr)
        return 2
    ratings = rate(matches)
    write_results(folder.path, matches, ratings)
    for rating in sorted(ratings, key=lambda r: -r.elo):
        print(f"{rating.elo:7.0f}  {rating.team} after {rating.frames} frames")
    draw_matrix(folder.path / "cross_play.png", matches)
    return 0


if __name__ == "__main__":
    sys.exit(main())
