"""Print how large the modules of veca_marl are, and how they import each other.

``python -m tools.count`` counts the files of this checkout, ``--rev REV`` those of a commit, and
``--against REV`` prints both side by side. Definitions are in ``tools/README.md``.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import zip_longest
from pathlib import Path

from tools import counting
from tools.checkout import ROOT

PACKAGE = "veca_marl"

Row = tuple[str, str]
Section = list[Row]


class GitError(RuntimeError):
    """Git cannot read a commit."""


def sources_of_checkout(root: Path, package: str) -> dict[str, str]:
    """Return the text of each module of a package in a folder by its path in that folder."""
    return {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for path in (root / package).rglob("*.py")
    }


def sources_of_commit(root: Path, package: str, revision: str) -> dict[str, str]:
    """Return the text of each module of a package in a commit by its path in the repository.

    Raises:
        GitError: If there is no such commit, or it does not have the package.
    """
    archive = ["git", "-C", str(root), "archive", "--format=tar", revision, package]
    done = subprocess.run(archive, capture_output=True, check=False)
    if done.returncode:
        raise GitError(f"{revision}: {done.stderr.decode().strip().splitlines()[-1]}")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as files:
        return dict(_python_texts(files))


def _python_texts(files: tarfile.TarFile) -> Iterator[tuple[str, str]]:
    for member in files:
        content = files.extractfile(member) if member.name.endswith(".py") else None
        if content is not None:
            yield member.name, content.read().decode("utf-8")


def summary(modules: Sequence[counting.Module]) -> Section:
    """Return the figures of the whole package as pairs of label and value."""
    total = counting.size(modules)
    small, small_fraction = counting.small(modules)
    lengths = counting.function_lines(modules)
    of_modules = sorted(module.lines for module in modules if not module.is_init)
    return [
        ("modules", str(total.modules)),
        ("of them __init__.py", str(sum(module.is_init for module in modules))),
        ("folders with modules", str(counting.folders(modules))),
        ("lines of code", str(total.lines)),
        ("import lines", f"{counting.import_fraction(modules):.1%}"),
        ("own modules imported, mean", f"{counting.own_imports(modules):.2f}"),
        ("  of modules that import one", f"{counting.own_imports_of_importers(modules):.2f}"),
        ("lines of own imports, mean", f"{counting.own_import_lines(modules):.2f}"),
        (f"modules under {counting.SMALL_LINES} lines", f"{small} ({small_fraction:.1%})"),
        ("modules that share a name", str(counting.namesakes(modules))),
        *((f"module lines p{n}", _percentile(of_modules, n)) for n in (50, 90)),
        ("functions", str(len(lengths))),
        *((f"function lines p{n}", _percentile(lengths, n)) for n in (50, 90)),
    ]


def _percentile(lengths: Sequence[int], percent: int) -> str:
    return str(counting.percentile(lengths, Fraction(percent, 100))) if lengths else "-"


def parts(modules: Sequence[counting.Module]) -> Section:
    """Return modules and lines of code of each subpackage as pairs of name and value."""
    sizes = counting.subpackages(modules)
    return [(name, f"{one.modules:4} {one.lines:6}") for name, one in sizes.items()]


def giants(modules: Sequence[counting.Module], count: int) -> list[str]:
    """Return a line for each of the largest modules."""
    return [f"{one.lines:5} {one.path}" for one in counting.largest(modules, count)]


def table(columns: Mapping[str, Section]) -> list[str]:
    """Return sections with the same labels side by side; a label that one lacks is ``-`` there."""
    values = [dict(section) for section in columns.values()]
    # in the order of the first column; what only others have follows
    labels = list(dict.fromkeys(label for one in values for label in one))
    rows = [["", *columns], *([label, *(v.get(label, "-") for v in values)] for label in labels)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    ]


def report(counted: Mapping[str, Sequence[counting.Module]], count: int) -> list[str]:
    """Return the lines that are printed.

    Args:
        counted: The modules by the title of their column.
        count: How many of the largest modules are named.
    """
    summaries = {title: summary(modules) for title, modules in counted.items()}
    sections = {title: sorted(parts(modules)) for title, modules in counted.items()}
    lists = [[title, *giants(modules, count)] for title, modules in counted.items()]
    width = max(len(line) for lines in lists for line in lines)
    beside = zip_longest(*lists, fillvalue="")
    return [
        *table(summaries),
        "",
        "modules and lines of code of subpackages",
        *_in_order(table(sections)),
        "",
        "largest modules, lines of code",
        *("  ".join(line.ljust(width) for line in row).rstrip() for row in beside),
    ]


def _in_order(lines: list[str]) -> list[str]:
    """Sort the rows below the title, which two columns with different subpackages mix."""
    return [lines[0], *sorted(lines[1:])]


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rev", metavar="REV", help="count this commit, not the files here")
    parser.add_argument("--against", metavar="REV", help="print this commit beside it")
    parser.add_argument("--largest", type=int, default=15, metavar="N", help="how many are named")
    return parser.parse_args()


def main() -> int:
    """Print the table; return the exit status."""
    asked = arguments()
    revisions = [asked.rev] if asked.against is None else [asked.against, asked.rev]
    try:
        texts = {
            revision or "files here": sources_of_checkout(ROOT, PACKAGE)
            if revision is None
            else sources_of_commit(ROOT, PACKAGE, revision)
            for revision in revisions
        }
    except GitError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    counted = {title: counting.read_modules(text) for title, text in texts.items()}
    print(*report(counted, asked.largest), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
