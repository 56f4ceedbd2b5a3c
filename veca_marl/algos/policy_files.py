"""The file of a policy without its run: parameters as safetensors, the rest as text beside them.

A file holds what a checkpoint holds as far as playing and `init_from` read it, the configuration
and the provenance of the run, and how the policy was evaluated. Reading it executes no code.
Parameters are stored in half precision, in which the policy is evaluated as well.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from veca_marl.algos.checkpoint_files import FORMAT, CheckpointError, checked_content
from veca_marl.algos.files import write_atomically
from veca_marl.migrations import KEY

LARGEST_BYTES = 2_000_000
_TEXT = "veca_marl"  # the entry of the metadata that holds everything else
_SEPARATOR = "/"


def write_policy(path: Path, content: Mapping[str, Any], about: Mapping[str, Any]) -> None:
    """Write a policy.

    Where critics do not fit into `LARGEST_BYTES`, they are left out: `init_from` begins with new
    ones then.

    Args:
        path: The file.
        content: What `read_checkpoint` returned; of its state only actors and networks are stored.
        about: Plain data: `config` and `bodies` of the run, and what else is to be known.

    Raises:
        CheckpointError: If the actors alone are larger than an entry may be.
        WriteError: If it cannot be written.
    """
    state = content["state"]
    networks = {
        team: {"network": one["network"]}
        for team, one in state["algorithm"].items()
        if "network" in one
    }
    data = _packed(content, networks, about)
    if len(data) > LARGEST_BYTES:
        data = _packed(content, {}, about)
    if len(data) > LARGEST_BYTES:
        raise CheckpointError(
            f"{path} would have {len(data)} bytes; a policy has at most {LARGEST_BYTES}"
        )
    write_atomically(path, data)


def _packed(
    content: Mapping[str, Any], networks: Mapping[str, Any], about: Mapping[str, Any]
) -> bytes:
    """Return the bytes of a file with the actors, and with some networks of the algorithms."""
    tensors, names = _flat({"actors": content["state"]["actors"], "algorithm": networks})
    plain = {
        "format": FORMAT,
        KEY: content[KEY],
        "identity": content["identity"],
        "config": content["config"],
        "algorithms": content["algorithms"],
        "names": names,
        "sha256": _digest(tensors),
        "about": dict(about),
    }
    return save(tensors, {_TEXT: json.dumps(plain)})


def read_policy(path: Path) -> dict[str, Any]:
    """Return the content of a policy's file, in the form of a checkpoint; `about` is beside it.

    Raises:
        CheckpointError: If it cannot be read, or was damaged.
    """
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise CheckpointError(f"{path} has more than {LARGEST_BYTES} bytes")
        with safe_open(path, framework="pt") as file:
            text = (file.metadata() or {}).get(_TEXT)
            if text is None:
                raise CheckpointError(f"{path} is no policy of veca_marl")
            plain: dict[str, Any] = json.loads(text)
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except FileNotFoundError as error:
        raise CheckpointError(f"{path} does not exist") from error
    except (OSError, SafetensorError, ValueError, RecursionError) as error:
        raise CheckpointError(f"cannot read {path}: {error}") from error
    try:
        if plain.pop("sha256") != _digest(tensors):
            raise CheckpointError(f"cannot read {path}: its numbers are not those that were stored")
        plain["state"] = _nested(plain.pop("names"), tensors)
        about = plain.pop("about")
    except (LookupError, TypeError, AttributeError) as error:
        raise CheckpointError(f"{path} is incomplete: {error}") from error
    if not isinstance(about, dict):
        raise CheckpointError(f"{path} is damaged: 'about' is no mapping")
    return {**checked_content(path, plain), "about": about}


def _flat(state: Mapping[str, Any]) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    """Return the tensors of a nested mapping once each, and which of them each name stands for."""
    tensors: dict[str, torch.Tensor] = {}
    names: dict[str, str] = {}
    by_content: dict[str, str] = {}
    pending: list[tuple[str, Any]] = [("", state)]
    while pending:
        name, entry = pending.pop(0)
        if isinstance(entry, Mapping):
            pending += [(f"{name}{_SEPARATOR}{key}", each) for key, each in entry.items()]
        elif isinstance(entry, torch.Tensor):
            tensor = entry.detach().cpu().contiguous()
            tensor = tensor.half() if tensor.is_floating_point() and _fits(tensor) else tensor
            content = _digest({"": tensor})
            names[name] = by_content.setdefault(content, name)
            tensors.setdefault(names[name], tensor)
        else:
            raise CheckpointError(f"{name} is a {type(entry).__name__}, and no tensor")
    return tensors, names


def _fits(tensor: torch.Tensor) -> bool:
    """Return whether all numbers can be stored in half precision."""
    return bool((tensor.abs() < torch.finfo(torch.float16).max).all())


def _nested(names: Mapping[str, str], tensors: Mapping[str, torch.Tensor]) -> dict[str, Any]:
    state: dict[str, Any] = {}
    for name, stored in names.items():
        *path, last = name.split(_SEPARATOR)[1:]
        node = state
        for key in path:
            node = node.setdefault(key, {})
        tensor = tensors[stored]
        node[last] = tensor.float() if tensor.dtype is torch.float16 else tensor.clone()
    return state


def _digest(tensors: Mapping[str, torch.Tensor]) -> str:
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name} {tensor.dtype} {list(tensor.shape)}\n".encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
