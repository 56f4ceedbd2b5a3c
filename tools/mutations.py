"""Seed faults into the package and see whether the quick tests notice them.

``python -m tools.mutations`` applies each fault of ``tools/mutations.toml`` in turn to a copy of
this checkout, runs the quick tests that are named there, and prints whether one of them fails.
``--only NAME ...`` tries some faults, ``--all-tests`` runs all quick tests for each. The exit
status is 1 if more than `--missed` faults are not noticed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tools.checkout import ROOT

LIST = ROOT / "tools" / "mutations.toml"
_COPIED = ("veca_marl", "hydra_plugins", "conf", "tests", "tools", "examples", "pyproject.toml")
_ALL_TESTS = ("tests",)
_TESTS_FAILED = 1  # exit status of pytest


class MutationError(RuntimeError):
    """A fault of the list cannot be seeded, or its tests cannot be run."""


@dataclass(frozen=True)
class Mutation:
    """A fault: a text of a module that is replaced.

    Attributes:
        name: What becomes wrong.
        file: Path of the module in the checkout.
        old: A text that occurs once in it.
        new: The text in its place.
        tests: Paths of the tests that are to notice it.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def seeded(self, source: str) -> str:
        """Return the source of the module with the fault.

        Raises:
            MutationError: If `old` does not occur exactly once.
        """
        if (count := source.count(self.old)) != 1:
            raise MutationError(f"{self.name}: {self.old!r} occurs {count} times in {self.file}")
        return source.replace(self.old, self.new)


def read_mutations(path: Path = LIST) -> list[Mutation]:
    """Return the faults of a list, in its order."""
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]
    return [Mutation(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]


@contextmanager
def copied_checkout(root: Path = ROOT) -> Iterator[Path]:
    """Copy what tests need of a checkout to a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="veca_mutations_") as folder:
        copy = Path(folder)
        for name in _COPIED:
            source = root / name
            if source.is_dir():
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(source, copy / name, ignore=ignored, symlinks=True)
            else:
                shutil.copy(source, copy / name)
        yield copy


@contextmanager
def seeded(mutation: Mutation, copy: Path) -> Iterator[None]:
    """Seed a fault into a copy, and take it out again."""
    module = copy / mutation.file
    source = module.read_text(encoding="utf-8")
    module.write_text(mutation.seeded(source), encoding="utf-8")
    try:
        yield
    finally:
        module.write_text(source, encoding="utf-8")


def is_noticed(mutation: Mutation, copy: Path, tests: Sequence[str]) -> bool:
    """Return whether one of some tests fails with a fault.

    Raises:
        MutationError: If the tests could not be run.
    """
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-m",
        "not slow",
        "-p",
        "no:cacheprovider",
    ]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    with seeded(mutation, copy):
        done = subprocess.run(
            [*command, *tests],
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode not in (0, _TESTS_FAILED):
        raise MutationError(f"{mutation.name}: pytest ended with {done.returncode}\n{done.stdout}")
    return done.returncode == _TESTS_FAILED


def chosen(mutations: Sequence[Mutation], names: Sequence[str]) -> list[Mutation]:
    """Return the faults with some names, or all if none is given.

    Raises:
        MutationError: If there is no fault of a name.
    """
    known = {mutation.name: mutation for mutation in mutations}
    if unknown := sorted(set(names) - set(known)):
        raise MutationError(f"no mutation {unknown}; there are {sorted(known)}")
    return [known[name] for name in names] if names else list(mutations)


def run(mutations: Sequence[Mutation], all_tests: bool) -> list[str]:
    """Try faults one after the other; return the names of those that no test notices."""
    missed = []
    with copied_checkout() as copy:
        for mutation in mutations:
            noticed = is_noticed(mutation, copy, _ALL_TESTS if all_tests else mutation.tests)
            print(f"{'noticed' if noticed else 'MISSED '}  {mutation.name}", flush=True)
            if not noticed:
                missed.append(mutation.name)
    return missed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutations", description=__doc__)
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--all-tests", action="store_true")
    parser.add_argument("--missed", type=int, default=2, help="faults that may be missed")
    options = parser.parse_args(arguments)
    try:
        mutations = chosen(read_mutations(), options.only)
        missed = run(mutations, options.all_tests)
    except MutationError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{len(mutations) - len(missed)} of {len(mutations)} faults are noticed")
    return int(len(missed) > options.missed)


if __name__ == "__main__":
    raise SystemExit(main())
