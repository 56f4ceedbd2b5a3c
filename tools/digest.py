"""Print digests of what veca_marl computes: they show whether a change of the code changed bytes.

``python -m tools.digest --save before.txt`` writes them, ``--against before.txt`` compares. They
hold for one machine with one set of library versions. See ``tools/README.md``.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from fnmatch import fnmatchcase
from pathlib import Path

import torch
import torchrl

import veca_marl
from tools.checkout import check_imported
from tools.digests.catalogue import Job, all_jobs, quick_jobs
from tools.digests.hashing import Digest, Item


def measure(job: Job) -> dict[str, str]:
    """Return the digest of each item of a job by its name; report each to stderr."""
    torch.set_num_threads(1)
    torchrl.logger.setLevel(logging.WARNING)  # it informs on the standard output
    return {item.name: _measure(item) for item in job}


def _measure(item: Item) -> str:
    began_s, digest = time.monotonic(), Digest()
    try:
        item.measure(digest)
    except Exception as error:
        error.add_note(f"while measuring {item.name}")
        raise
    text = digest.text()
    print(f"{item.name} {text} {time.monotonic() - began_s:.1f} s", file=sys.stderr, flush=True)
    return text


def selected(jobs: Sequence[Job], pattern: str) -> list[Job]:
    """Return the items whose names match a shell pattern, in their jobs."""
    kept = [tuple(item for item in job if fnmatchcase(item.name, pattern)) for job in jobs]
    return [job for job in kept if job]


def measure_all(jobs: Sequence[Job], processes: int) -> dict[str, str]:
    """Return all digests, in the order of the names.

    Args:
        jobs: What is measured.
        processes: How many jobs are measured at the same time.
    """
    found: dict[str, str] = {}
    with ThreadPoolExecutor(processes) as pool:
        for digests in pool.map(_measure_apart, jobs):
            found.update(digests)
    return dict(sorted(found.items()))


def _measure_apart(job: Job) -> dict[str, str]:
    """Measure a job in a fresh process.

    The processes of a `ProcessPool` keep what earlier jobs have loaded. Python's own pool with
    `max_tasks_per_child=1` would be shorter, but hangs (CPython issue 115634).
    """
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, job).result()


def to_text(digests: Mapping[str, str]) -> str:
    """Return a line for each digest."""
    return "".join(f"{name} {digest}\n" for name, digest in digests.items())


def read(path: Path) -> dict[str, str]:
    """Return the digests of a file that `to_text` wrote.

    Raises:
        ValueError: If a line is not a name and a digest.
    """
    digests = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        words = line.split()
        if len(words) != 2:
            raise ValueError(f"{path}, line {number}: {line!r} is not a name and a digest")
        digests[words[0]] = words[1]
    return digests


def differences(before: Mapping[str, str], now: Mapping[str, str], pattern: str) -> Iterator[str]:
    """Return a line for each digest that is not the same in both.

    Args:
        before: Those of the file.
        now: Those of this run.
        pattern: Items whose names do not match it are missing in this run on purpose.
    """
    for name in sorted({*before, *now}):
        if name not in before:
            yield f"new: {name}"
        elif name not in now:
            if fnmatchcase(name, pattern):
                yield f"missing: {name}"
        elif before[name] != now[name]:
            yield f"changed: {name} {before[name]} -> {now[name]}"


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", type=Path, metavar="FILE", help="write the digests to a file")
    parser.add_argument("--against", type=Path, metavar="FILE", help="compare; exit 1 on any")
    parser.add_argument("--only", default="*", metavar="PATTERN", help="such as 'train/*'")
    parser.add_argument("--quick", action="store_true", help="a rollout of each task only")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="default 2")
    return parser.parse_args()


def main() -> int:
    """Print the digests; return the exit status."""
    asked = arguments()
    pattern = "rollout/*" if asked.quick and asked.only == "*" else asked.only
    before = None if asked.against is None else read(asked.against)
    check_imported(veca_marl.__file__)
    jobs = selected(quick_jobs() if asked.quick else all_jobs(), pattern)
    if not jobs:
        print(f"error: --only {asked.only}: no item has such a name", file=sys.stderr)
        return 2
    now = measure_all(jobs, asked.processes)
    print(to_text(now), end="")
    if asked.save is not None:
        asked.save.write_text(to_text(now), encoding="utf-8")
    found = [] if before is None else list(differences(before, now, pattern))
    if before is not None:
        print(*found, f"{len(found)} differences from {asked.against}", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
