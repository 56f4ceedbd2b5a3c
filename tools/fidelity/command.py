"""Measure laws of physics and of the senses: ``python -m tools.fidelity``.

Writes ``fidelity.md`` (a table of every law: theory, measured, tolerance, verdict) and its plots.
Broken laws are named at the end, and the exit status is 1.

    python -m tools.fidelity
    python -m tools.fidelity sections=[rigid_bodies] to=/tmp/fidelity
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from importlib import import_module

from tools.fidelity.law import Section
from tools.fidelity.page import number, write_page
from veca_marl.config import ConfigError
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.pool import ProcessPool
from veca_marl.registry import unknown
from veca_marl.reports.figure import PlotError, check_plotting

SECTIONS: dict[str, str] = {
    "collisions": "tools.fidelity.mechanics.collisions",
    "doppler": "tools.fidelity.hearing.doppler",
    "ears": "tools.fidelity.hearing.ears",
    "inertia": "tools.fidelity.mechanics.inertia",
    "joints": "tools.fidelity.mechanics.joints",
    "localisation": "tools.fidelity.hearing.localisation",
    "momentum": "tools.fidelity.mechanics.momentum",
    "near_field": "tools.fidelity.hearing.near_field",
    "rigid_bodies": "tools.fidelity.mechanics.rigid_bodies",
    "rooms": "tools.fidelity.hearing.rooms",
    "touch": "tools.fidelity.touch.laws",
    "towers": "tools.fidelity.mechanics.towers",
    "vision": "tools.fidelity.vision",
}
"""Module of each section, imported when it is measured, with ``section() -> Section``."""


def check_names(names: list[str]) -> None:
    """Check that sections exist.

    Raises:
        ValueError: If one does not; the message lists all.
    """
    for name in names:
        if name not in SECTIONS:
            raise ValueError(unknown("section", name, list(SECTIONS)))


def measure(name: str) -> Section:
    """Return the measured section with this name."""
    try:
        section: Section = import_module(SECTIONS[name]).section()
    except Exception as error:
        error.add_note(f"in the section {name!r}")
        raise
    return section


@dataclass
class FidelityOptions:
    """Options of the command.

    Attributes:
        sections: Sections that are measured; empty measures all.
        to: Folder that the page and its pictures are written to.
        processes: Sections that are measured at the same time; 0 is the number of cores.
    """

    sections: list[str] = field(default_factory=list)
    to: str = "runs/fidelity"
    processes: int = 0

    def __post_init__(self) -> None:
        check_names(self.sections)
        if self.processes < 0:
            raise ValueError(f"processes must be 0 or more, got {self.processes}")


def measure_all(names: Sequence[str], processes: int) -> dict[str, Section]:
    """Measure sections in processes, print the progress, return them in the order of `names`.

    Raises:
        WorkerError: If a section raises an exception; a note has its name and the traceback.
    """
    done: dict[str, Section] = {}
    start = time.monotonic()
    for name, section in _measured(names, processes):
        done[name] = section
        count, laws, seconds = len(done), len(section.laws), time.monotonic() - start
        held = f"{laws - len(section.broken)} of {laws} laws hold"
        print(f"{count}/{len(names)} {name}: {held} ({seconds:.0f} s)", flush=True)
    return {name: done[name] for name in names}


def _measured(names: Sequence[str], processes: int) -> Iterator[tuple[str, Section]]:
    pool = ProcessPool("measuring process", _serve, min(processes, len(names)))
    with closing(pool):
        for number, section in pool.answers(names):
            yield names[number], section


def _serve(_: Callable[[], None]) -> Callable[[str], Section]:
    """Return what measures in a process of a pool."""
    return measure


def broken_laws(sections: dict[str, Section]) -> list[str]:
    """Return a line for each broken law: section, law, measured value and permitted interval."""
    return [
        f"{name}: {law.name}: {number(law.measured, law.unit)} "
        f"is not in [{number(law.low)}, {number(law.high)}]"
        for name, section in sections.items()
        for law in section.broken
    ]


def run(options: FidelityOptions, overrides: list[str]) -> list[str]:
    """Measure, write the page, and return a line for each broken law.

    Raises:
        ConfigError: If there are other overrides.
        PlotError: If matplotlib is missing.
        OSError: If a file cannot be written.
        WorkerError: See `measure_all`.
    """
    if overrides:
        raise ConfigError(f"{overrides[0]}: fidelity has the options sections, to and processes")
    folder = check_folder(options.to, "to")
    check_plotting()
    names = [name for name in SECTIONS if name in options.sections or not options.sections]
    sections = measure_all(names, options.processes or usable_cores())
    print(f"page: {write_page(folder, sections)}")
    return broken_laws(sections)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0, 1 if a law is broken, 2 after an error."""
    broken: list[str] = []

    def call(options: FidelityOptions, overrides: list[str]) -> None:
        broken.extend(run(options, overrides))

    errors = (PlotError, OSError)
    command = CommandLine(
        "fidelity", FidelityOptions, str(__doc__), errors, outputs=("to",), places=("to",)
    )
    status = command.run(call, words)
    for line in broken:
        print(f"broken: {line}", file=sys.stderr)
    return status or int(bool(broken))
