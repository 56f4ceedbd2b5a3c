"""Record what experts do: ``python -m veca_marl.demonstrations +task=GrabObject episodes=500``.

The scripted expert of the task plays whole episodes, all teams that are not opponents, and what
each of its agents observed and did is stored in ``to``: for ``algo=bc demonstrations=FOLDER``, and
for the ``demonstrations=FOLDER`` of other algorithms. The same command continues a recording that
was interrupted; more episodes are added by a larger number. The number of processes changes
no byte of the data.

    python -m veca_marl.demonstrations show from=FOLDER
    python -m veca_marl.demonstrations export from=FOLDER to=FOLDER format=lerobot

    python -m veca_marl.demonstrations table tasks=[KickTheBall] to=FOLDER

show checks a recording and says what is in it; export writes it for Minari or LeRobot; table
compares expert, imitation and random policy. Each has a --help of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import torch
from omegaconf import MISSING

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.demonstration_files import Card, DemonstrationsError
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.files import WriteError
from veca_marl.config import ConfigError, compose
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.demonstrations.episode_files import Archive
from veca_marl.demonstrations.export.agent import DemonstratedAgent
from veca_marl.demonstrations.export.lerobot_format import export_lerobot
from veca_marl.demonstrations.export.minari_format import export_minari
from veca_marl.demonstrations.record import Recording, make_card, record
from veca_marl.demonstrations.table import TableOptions, make_table
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.supervision import WorkerError
from veca_marl.runs.lock import locked
from veca_marl.runs.run_folder import provenance

_ERRORS = (WriteError, WorkerError, DemonstrationsError, ModuleNotFoundError)


@dataclass
class RecordOptions:
    """Options of the command.

    Attributes:
        to: Folder of the demonstrations; None is
            ``runs/demonstrations/TASK``.
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
    folder = check_folder(options.to or f"runs/demonstrations/{cfg.task.name}", "to")
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


class Format(Enum):
    """A format of other libraries.

    Attributes:
        minari: Of Minari, for tasks of one agent.
        lerobot: Version 3.0 of LeRobot's, one agent at a time.
    """

    minari = "minari"
    lerobot = "lerobot"


@dataclass
class ShowOptions:
    """Options of ``show``.

    Attributes:
        demonstrations: Folder of the demonstrations.
    """

    demonstrations: str = MISSING


@dataclass
class ExportOptions:
    """Options of ``export``.

    Attributes:
        demonstrations: Folder of the demonstrations.
        to: Folder that is written: of LeRobot a data set, of Minari one that holds data sets.
        format: The format.
        agent: The agent that is exported: TEAM, or TEAM_INDEX; None is the only one.
    """

    demonstrations: str = MISSING
    to: str = MISSING
    format: Format = Format.lerobot
    agent: str | None = None


_SHOW = """
Check a recording, all of its bytes, and say what is in it:

    python -m veca_marl.demonstrations show demonstrations=FOLDER
"""

_EXPORT = """
Write a recording in the format of another library, with the extra [minari] or [lerobot]:

    python -m veca_marl.demonstrations export demonstrations=FOLDER to=FOLDER format=minari
    python -m veca_marl.demonstrations export demonstrations=FOLDER to=FOLDER agent=red_0
"""


def show(options: ShowOptions, overrides: list[str]) -> None:
    """Print what a recording holds."""
    _refuse(overrides)
    found = Demonstrations(options.demonstrations)
    print(*lines(found.card), sep="\n")


def export(options: ExportOptions, overrides: list[str]) -> None:
    """Write a recording in another format."""
    _refuse(overrides)
    folder = check_folder(options.to, "to")
    agent = DemonstratedAgent(Demonstrations(options.demonstrations), options.agent)
    if options.format is Format.minari:
        name = export_minari(agent, folder)
        print(f"data set {name}: MINARI_DATASETS_PATH={folder}")
    else:
        export_lerobot(agent, folder)
        print(f"data set of LeRobot: {folder}")


def table(options: TableOptions, overrides: list[str]) -> None:
    """Print the table of expert, imitation and random policy."""
    print(make_table(options, overrides))


def _refuse(overrides: Sequence[str]) -> None:
    if overrides:
        raise ConfigError(f"{overrides[0]}: the configuration is that of the recording")


_TABLE = """
Compare the expert, what imitates it and the random policy on frozen episodes:

    python -m veca_marl.demonstrations table tasks=[KickTheBall,MoveToTarget] to=runs/imitation
    python -m veca_marl.demonstrations table tasks=[KickTheBall] algos=[bc,dagger] episodes=50 \\
        frozen=20 total_frames=40960

Recordings, runs and scores stay in the folder, and are not made again.
"""

_MORE: dict[str, tuple[CommandLine[Any], Callable[[Any, list[str]], None]]] = {
    "show": (CommandLine("demonstrations show", ShowOptions, _SHOW, _ERRORS), show),
    "export": (
        CommandLine("demonstrations export", ExportOptions, _EXPORT, _ERRORS, outputs=("to",)),
        export,
    ),
    "table": (
        CommandLine("demonstrations table", TableOptions, _TABLE, (*_ERRORS, CheckpointError)),
        table,
    ),
}


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    given = list(sys.argv[1:] if words is None else words)
    if given and given[0] in _MORE:
        line, call = _MORE[given[0]]
        return line.run(call, given[1:])
    record_line = CommandLine(
        "demonstrations", RecordOptions, str(__doc__), _ERRORS, outputs=("to",)
    )
    return record_line.run(run, given)
