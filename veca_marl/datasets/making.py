"""The making of a data set: blocks of samples by any number of processes, continued after an end.

A sample depends only on data set, seed and index, and each block has its position in the files: the
bytes are the same with any number of processes, and after any number of ends and continuations.
"""

from __future__ import annotations

import json
import platform
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from omegaconf import OmegaConf
from tqdm import tqdm

from veca_marl.algos.files import write_atomically
from veca_marl.config import ConfigError
from veca_marl.datasets.configuration import DatasetConfig, make_dataset
from veca_marl.datasets.dataset import DATASETS, Dataset
from veca_marl.datasets.storage import (
    CARD,
    DATA,
    PLAN,
    DatasetError,
    Plan,
    StoredDataset,
    block_size,
    checksum_of,
    finish,
    load,
    prepare_files,
    record_block,
    recorded_blocks,
    write_block,
)
from veca_marl.processes.pool import ProcessPool
from veca_marl.runs.lock import locked
from veca_marl.stored_files import StoredFileError, read_json
from veca_marl.version import __version__

Block = tuple[int, dict[str, str]]
"""Number of a block, and the digests of its fields."""


@dataclass(frozen=True)
class Made:
    """A data set that was made, or was there already.

    Attributes:
        stored: The data set.
        blocks: Number of blocks that this call made.
    """

    stored: StoredDataset
    blocks: int


def make_plan(config: DatasetConfig, dataset: Dataset, n: int, seed: int) -> Plan:
    """Return the plan of a data set."""
    used = {name: config.senses.of(name) for name in dataset.senses_used}
    parts = {"dataset": config.dataset, "playground": config.playground, **used}
    plain = {
        key: OmegaConf.to_container(OmegaConf.structured(part), enum_to_str=True)
        for key, part in parts.items()
    }
    size = block_size(dataset.sample_bytes)
    return Plan(dataset.name, n, seed, size, dataset.fields, _jsonable(plain), __version__)


def _jsonable(value: Any) -> Any:
    """Return plain data as it is read back from JSON."""
    if isinstance(value, Mapping):
        return {str(key): _jsonable(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_jsonable(entry) for entry in value]
    return value


def make(
    config: DatasetConfig,
    folder: Path,
    n: int,
    seed: int,
    processes: int,
    command: str,
    progress: bool = True,
) -> Made:
    """Make a data set, or what is left of one; return it.

    Args:
        config: What it contains.
        folder: Where it is to be.
        n: Number of samples.
        seed: Seed of all of them.
        processes: Number of processes; with 1 this process makes the samples.
        command: The command, for the card.
        progress: Whether to show a progress bar.

    Raises:
        ConfigError: If a choice is impossible, or the folder holds something else.
        WriteError: If it cannot be written; what is complete is kept.
        WorkerError: If a process fails.
    """
    dataset = make_dataset(config)
    plan = make_plan(config, dataset, n, seed)
    with locked(folder):
        present = _present(folder, plan)
        if present is not None:
            return Made(present, 0)
        _check_space(folder, plan)
        write_atomically(folder / PLAN, _plan_text(plan))
        prepare_files(folder, plan)
        done = recorded_blocks(folder, plan)
        left = [block for block in range(plan.blocks) if block not in done]
        blocks = _blocks(config, dataset, folder, plan, left, processes)
        with tqdm(total=n, desc=plan.name, unit="sample", disable=not progress) as bar:
            bar.update(sum(len(plan.rows(block)) for block in done))
            for block, digests in blocks:
                record_block(folder, block, digests)
                done[block] = digests
                bar.update(len(plan.rows(block)))
        digests_of_all = [done[block] for block in range(plan.blocks)]
        finish(folder, make_card(plan, digests_of_all, command))
        return Made(load(folder), len(left))


def _plan_text(plan: Plan) -> str:
    return json.dumps(plan.to_dict(), indent=1) + "\n"


def make_card(plan: Plan, blocks: list[dict[str, str]], command: str) -> dict[str, Any]:
    """Return the content of the card.

    Args:
        plan: What the data set is.
        blocks: Digests of the fields in each block.
        command: The command that made it.
    """
    packages = ("numpy", "scipy", "numba", "pybullet", "opencv-python-headless")
    return plan.to_dict() | {
        "command": command,
        "description": (DATASETS[plan.name].__doc__ or "").strip().partition("\n")[0],
        "versions": {"python": platform.python_version(), **{p: version(p) for p in packages}},
        "machine": platform.machine(),
        "checksum": checksum_of(blocks),
        "blocks": blocks,
    }


def _present(folder: Path, plan: Plan) -> StoredDataset | None:
    """Return the data set in a folder if it is complete; raise if there is another one."""
    if (folder / CARD).exists():
        try:
            stored = load(folder)
        except DatasetError as error:
            raise ConfigError(f"{error}; give another out=FOLDER, or delete it") from error
        _check_same(folder, plan, stored.plan)
        return stored
    if (folder / PLAN).exists():
        try:
            begun = Plan.from_dict(read_json(folder / PLAN), folder / PLAN)
        except (StoredFileError, DatasetError) as error:
            raise ConfigError(f"{error}; give another out=FOLDER, or delete it") from error
        if recorded_blocks(folder, begun):
            _check_same(folder, plan, begun)
        else:  # nothing is lost
            shutil.rmtree(folder / DATA, ignore_errors=True)
    elif folder.is_dir() and any(path.name[0] != "." for path in folder.iterdir()):
        raise ConfigError(f"out={folder} holds other files; give a new folder")
    return None


def _check_same(folder: Path, plan: Plan, other: Plan) -> None:
    asked, found = _flat(plan.to_dict()), _flat(other.to_dict())
    changed = [key for key in {**asked, **found} if asked.get(key) != found.get(key)]
    if changed:
        key = changed[0]
        raise ConfigError(
            f"out={folder} holds another data set: {key}={found.get(key)!r:.60}, and not "
            f"{asked.get(key)!r:.60}; give another out=FOLDER"
        )


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    if isinstance(value, dict):
        parts = [_flat(entry, f"{key}.{name}".lstrip(".")) for name, entry in value.items()]
        return {name: entry for part in parts for name, entry in part.items()}
    return {key: value}


def _check_space(folder: Path, plan: Plan) -> None:
    """Raise `ConfigError` if the disk has no room; files are sparse until blocks are written."""
    existing = next(path for path in folder.absolute().parents if path.is_dir())
    written = sum(len(plan.rows(block)) for block in recorded_blocks(folder, plan)) * (
        plan.n_bytes // plan.n
    )
    needed, free = plan.n_bytes - written, shutil.disk_usage(existing).free
    if needed > free:
        raise ConfigError(
            f"out={folder}: {needed / 1e6:,.0f} MB are needed, {free / 1e6:,.0f} MB are free on "
            "the disk; choose another out=FOLDER or a smaller n"
        )


def _blocks(
    config: DatasetConfig,
    dataset: Dataset,
    folder: Path,
    plan: Plan,
    left: list[int],
    processes: int,
) -> Iterator[Block]:
    """Make blocks, in any order."""
    if min(processes, len(left)) <= 1:
        yield from (make_block(dataset, folder, plan, block) for block in left)
        return
    server = partial(_make_server, config, folder, plan)
    pool = ProcessPool("data set process", server, min(processes, len(left)))
    with closing(pool):
        yield from (answer for _, answer in pool.answers(left))


def _make_server(
    config: DatasetConfig, folder: Path, plan: Plan, progress: Callable[[], None]
) -> Callable[[int], Block]:
    """Return what makes a block in a process of its own."""
    dataset = make_dataset(config)
    return partial(make_block, dataset, folder, plan, progress=progress)


def make_block(
    dataset: Dataset,
    folder: Path,
    plan: Plan,
    block: int,
    progress: Callable[[], None] = lambda: None,
) -> Block:
    """Make the samples of a block and write them to the disk."""
    arrays: dict[str, NDArray[Any]] = {
        name: np.empty((len(plan.rows(block)), *field.shape), field.dtype)
        for name, field in plan.fields.items()
    }
    for row, index in enumerate(plan.rows(block)):
        for name, value in dataset.sample(plan.seed, index).items():
            arrays[name][row] = value
        progress()
    return block, write_block(folder, plan, block, arrays)
