"""Play past policies of a self-play run against each other: ``veca_marl.tournament run=runs/...``.

Writes ``cross_play.csv`` (every match), ``elo.csv`` (the rating of every policy) and, with the
extra ``[plot]``, ``cross_play.png`` (the matrix of points) into the folder of the run.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from omegaconf import MISSING

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.algos.selfplay import Match, Pool, Rating, play_all, rate, table_of_points
from veca_marl.config import Config, ConfigError, to_config
from veca_marl.config.command_line import CommandLine, check_file, check_folder
from veca_marl.config.stored import change
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.assembly import make_learners, read_specs
from veca_marl.runs.run_folder import RunFolder, writable_run

_MATCHES, _RATINGS, _PICTURE = "cross_play.csv", "elo.csv", "cross_play.png"


@dataclass
class TournamentCfg:
    """Players, and what counts as a draw.

    Attributes:
        members: Number of past policies of each team, spread evenly over the run.
        draw_margin: In tasks without a goal, returns that differ by less than this are a draw.
    """

    members: int = 6
    draw_margin: float = 0.5

    def __post_init__(self) -> None:
        if self.members < 2:
            raise ValueError(f"tournament.members must be at least 2, got {self.members}")
        if not self.draw_margin >= 0:
            raise ValueError(f"tournament.draw_margin must be 0 or more, got {self.draw_margin}")


@dataclass
class TournamentOptions:
    """Options of the command.

    Attributes:
        run: Folder of a self-play run.
        episodes: Number of episodes of each match.
        tournament: Players, and what counts as a draw.
    """

    run: str = MISSING
    episodes: int = 16
    tournament: TournamentCfg = field(default_factory=TournamentCfg)

    def __post_init__(self) -> None:
        if self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")


def tournament(
    folder: RunFolder, options: TournamentOptions, overrides: Sequence[str] = ()
) -> list[Match]:
    """Play the tournament of a run.

    Args:
        folder: The run.
        options: Players and number of episodes.
        overrides: Changes of the stored configuration.

    Raises:
        ConfigError: If it is not a self-play run, or a team has fewer than two past policies.
    """
    node = folder.typed_config(overrides)
    change(node, overrides)
    cfg = to_config(node)
    pool, members = Pool(folder.pool), options.tournament.members
    chosen = {team: spread(pool.members(team), members) for team in cfg.self_play.teams}
    if not chosen:
        raise ConfigError(f"{folder.path}: no past policies; it was run without self_play.teams")
    for team, frames in chosen.items():
        if len(frames) < 2:
            raise ConfigError(
                f"{folder.path}: past policies of {team}: {len(frames)}, and 2 are needed; "
                "continue the run"
            )
    return _play(cfg, pool, chosen, options)


def _play(
    cfg: Config, pool: Pool, chosen: dict[str, list[int]], options: TournamentOptions
) -> list[Match]:
    learners = make_learners(cfg, read_specs(cfg.game), torch.device("cpu"))
    env = VecaEnv(cfg.game, min(options.episodes, cfg.eval.worlds), cfg.seed)
    margin = options.tournament.draw_margin
    matches = play_all(
        env, learners.policy.copy(), pool, chosen, options.episodes, margin, cfg.seed
    )
    env.close()
    return matches


def spread(frames: Sequence[int], count: int) -> list[int]:
    """Return `count` of the numbers, evenly spaced, with the first and the last."""
    if len(frames) <= count:
        return list(frames)
    return [frames[i] for i in np.linspace(0, len(frames) - 1, count).round().astype(int)]


def write_results(path: Path, matches: list[Match], ratings: list[Rating]) -> None:
    """Write the matches and the ratings as CSV into a folder."""
    first, second = matches[0].members
    head = [f"{first}_frames", f"{second}_frames", "episodes"]
    head += [f"{first}_wins", f"{second}_wins", "ahead"]
    played = [
        [*m.members.values(), m.episodes, *m.wins.values(), f"{m.ahead:.6g}"] for m in matches
    ]
    write_atomically(path / _MATCHES, _table([head, *played]))
    rated = [[r.team, r.frames, f"{r.elo:.1f}"] for r in ratings]
    write_atomically(path / _RATINGS, _table([["team", "frames", "elo"], *rated]))


def _table(rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text).writerows(rows)
    return text.getvalue()


def draw_matrix(path: Path, matches: list[Match]) -> None:
    """Draw the points of the first team as a PNG file.

    Raises:
        ModuleNotFoundError: Without the extra ``[plot]``.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "the picture needs matplotlib: pip install 'veca_marl[plot]'",
            name=error.name,
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
    axes.set(xlabel=f"training frames of {second}", ylabel=f"training frames of {first}")
    figure.colorbar(image, label=f"points of {first} (win 1, draw 1/2)")
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=120, bbox_inches="tight")
    write_atomically(path, picture.getbuffer())


def run(options: TournamentOptions, overrides: list[str]) -> None:
    """Play the tournament, print the ratings and write the results into the folder of the run."""
    torch.set_num_threads(1)
    folder = writable_run(Path(options.run), "run=")
    check_folder(folder.path, "run")
    for name in (_MATCHES, _RATINGS, _PICTURE):
        check_file(folder.path / name, "run")
    matches = tournament(folder, options, overrides)
    ratings = rate(matches)
    for rating in sorted(ratings, key=lambda r: -r.elo):
        print(f"{rating.elo:7.0f}  {rating.team} after {rating.frames} frames")
    write_results(folder.path, matches, ratings)
    draw_matrix(folder.path / _PICTURE, matches)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    errors = (CheckpointError, WriteError, ModuleNotFoundError)
    return CommandLine("tournament", TournamentOptions, str(__doc__), errors, places=("run",)).run(
        run, words
    )


if __name__ == "__main__":
    sys.exit(main())
