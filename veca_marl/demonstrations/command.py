"""Record what experts do: ``python -m veca_marl.demonstrations +task=GrabObject episodes=500``.

The scripted expert of the task plays whole episodes, all teams that are not opponents, and what
each of its agents observed and did is stored in ``to``: for ``algo=bc demonstrations=FOLDER``, and
for the ``demonstrations=FOLDER`` of other algorithms. The same command continues a recording that
was interrupted; more episodes are added by a larger number. The number of processes changes
no byte of the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from veca_marl.algos.demonstrations import Card, DemonstrationsError
from veca_marl.algos.files import WriteError
from veca_marl.config import ConfigError, compose
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.demonstrations.episode_files import Archive
from veca_marl.demonstrations.record import Recording, make_card, record
from veca_marl.processes.supervision import WorkerError
from veca_marl.runs.cores import usable_cores
from veca_marl.runs.lock import locked
from veca_marl.runs.run_folder import provenance

_ERRORS = (WriteError, WorkerError, DemonstrationsError)


@dataclass
class RecordOptions:
    """Options of the command.

    Attributes:
        to: Folder of the demonstrations; None is ``demonstrations/TASK``.
        episodes: Number of episodes.
        seed: Seed of the episodes.
        processes: Processes that play; 0 plays in this one; None is one for each core.
    """

    to: str | None = None
    episodes: int = 500
    seed: int = 0
    processes: int | None = None

    def __post_init__(self) -> None:
        if self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        for name in ("seed", "processes"):
            if (getattr(self, name) or 0) < 0:
                raise ValueError(f"{name} must be 0 or more, got {getattr(self, name)}")


def run(options: RecordOptions, overrides: list[str]) -> None:
    """Record the episodes that are missing and print what there is."""
    torch.set_num_threads(1)
    cfg = compose(overrides)
    if cfg.frozen:
        raise ConfigError(
            f"opponent.{next(iter(cfg.frozen))}: opponents of demonstrations are expert, random "
            "or idle"
        )
    folder = check_folder(options.to or f"demonstrations/{cfg.task.name}", "to")
    recording = Recording(cfg.game, options.episodes, options.seed, tuple(cfg.plugins))
    processes = usable_cores() if options.processes is None else options.processes
    card = make_card(recording, provenance(overrides))
    with locked(folder):
        archive = Archive(folder, card)
        archive.begin()
        card = record(recording, archive, processes)
    print(*lines(card), f"demonstrations: {folder}", sep="\n")


def lines(card: Card) -> list[str]:
    """Return what a card says as lines of text."""
    found = card.more.get("summary", {})
    size = sum(array.row_bytes for array in card.arrays) * (found["steps"] + card.episodes)
    text = [f"{card.task}: {card.episodes} episodes, {found['steps']} steps, {size / 1e6:,.1f} MB"]
    for team, scores in found["teams"].items():
        solved = f", solved {scores['solved']:.2f}" if "solved" in scores else ""
        text.append(
            f"{team}: return {scores['mean_return']:.3f} "
            f"(standard deviation {scores['deviation']:.3f}){solved}"
        )
    return [*text, f"checksum {card.checksum}"]


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("demonstrations", RecordOptions, str(__doc__), _ERRORS, outputs=("to",)).run(
        run, words
    )
