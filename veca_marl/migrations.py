"""Configurations that older versions stored, brought to the form of this version.

Each stored configuration has a number, `CONFIG_VERSION` of the code that stored it, under the key
`KEY`. One without a number has version 0: version 0.2.0 stored it, or a later commit before there
were numbers, which knew some of the fields that step 1 adds.

`STEPS` are the only record of what changed. They name fields by their paths in the configuration
of a run; whatever else is stored (the algorithms in a checkpoint, the parameters of a task) is
passed with the keys that lead to it there, such as ``{"task": parameters}``. A field that is absent
and in no step takes the default of its dataclass: a new field whose default keeps the former
behaviour needs no step for runs to be read, which is how plug-ins add fields. A step keeps digests
of configurations valid as well, see `first_form`.

All functions take and return plain data (mappings, lists, numbers, texts). This module imports
nothing of the package, so that every layer can use it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

KEY = "config_version"
Plain = dict[str, Any]


class VersionError(ValueError):
    """A stored configuration has a version that this code does not know."""


@dataclass(frozen=True)
class Change(ABC):
    """One change of the nodes at a path.

    Attributes:
        path: Dotted path in the configuration of a run; empty is its root, ``*`` stands for each
            key of a mapping and each element of a list.
    """

    path: str

    @abstractmethod
    def apply(self, node: Plain) -> None:
        """Bring a node to the form of the next version."""

    @abstractmethod
    def undo(self, node: Plain) -> None:
        """Bring a node to the form of the version before, as far as that can express it."""


@dataclass(frozen=True)
class Added(Change):
    """Fields that were added.

    Attributes:
        values: The fields, with the values that do what was done before.
        name: Name of the entry of a registry that has them, which the node has as `name`; None
            for nodes of any name.
        beside: A field of the nodes that have them, where their type has no name; None for all.
    """

    values: Mapping[str, Any]
    name: str | None = None
    beside: str | None = None

    def apply(self, node: Plain) -> None:
        """See `Change`; fields that are present stay as they are."""
        if self._concerns(node):
            node |= deepcopy(dict(self.values)) | node

    def undo(self, node: Plain) -> None:
        """See `Change`; fields with other values stay."""
        if self._concerns(node):
            for key, value in self.values.items():
                if key in node and node[key] == value:
                    del node[key]

    def _concerns(self, node: Plain) -> bool:
        named = self.name is None or node.get("name") == self.name
        return named and (self.beside is None or self.beside in node)


@dataclass(frozen=True)
class Renamed(Change):
    """A field that got another name.

    Attributes:
        before: Its name before.
        now: Its name since.
        beside: A field of the nodes that have it, where their type has no name; None for all.
    """

    before: str
    now: str
    beside: str | None = None

    def apply(self, node: Plain) -> None:
        """See `Change`; a node that has the new name already stays as it is."""
        if self.now not in node and (self.beside is None or self.beside in node):
            _rename(node, self.before, self.now)

    def undo(self, node: Plain) -> None:
        """See `Change`; where the former name now is that of something else, nothing changes."""
        if self.before not in node:
            _rename(node, self.now, self.before)


def _rename(node: Plain, before: str, now: str) -> None:
    if before in node:
        node[now] = node.pop(before)


@dataclass(frozen=True)
class Replaced(Change):
    """A value of a field that is written in another way.

    Attributes:
        key: The field.
        before: The value before.
        now: The value since.
    """

    key: str
    before: Any
    now: Any

    def apply(self, node: Plain) -> None:
        """See `Change`."""
        _replace(node, self.key, self.before, self.now)

    def undo(self, node: Plain) -> None:
        """See `Change`."""
        _replace(node, self.key, self.now, self.before)


@dataclass(frozen=True)
class Grouped(Change):
    """Worker processes of equally many worlds, which became groups that any processes play."""

    def apply(self, node: Plain) -> None:
        """See `Change`."""
        if "processes" in node and "groups" not in node:
            before = node["processes"]
            node |= {"groups": max(before, 1), "processes": None if before else 0}

    def undo(self, node: Plain) -> None:
        """See `Change`; groups that one process plays cannot be expressed, unless it is one."""
        if "groups" in node and "processes" in node:
            if node["processes"] is None:
                node["processes"] = node.pop("groups")
            elif node["processes"] == 0 and node["groups"] == 1:
                del node["groups"]


def _replace(node: Plain, key: str, before: Any, now: Any) -> None:
    if key in node and node[key] == before:
        node[key] = deepcopy(now)


@dataclass(frozen=True)
class Step:
    """From one version to the next.

    Attributes:
        changes: Changes of configurations, in their order.
        state: Entries that the states in checkpoints got, with the values of runs without.
    """

    changes: Sequence[Change]
    state: Mapping[str, Any] = field(default_factory=dict)


_IMAGE_WINDOWS = {"kernels": [8, 4, 3], "strides": [4, 2, 1]}
_CALLS = {"call_pause_s": 0.0}
_WALKS = {"restitution": 0.0, "stride_height_m": 0.0}
_IMITATION = {
    "imitation": {
        "coefficient": 0.3,
        "frames": 60_000,
        "batch_size": 64,
        "burn_in": 16,
        "least_scale": 0.2,
    }
}
_PPO = {"critic_learning_rate": 1e-3, "credit": "nothing", **_IMITATION}
_SAC = {"demonstrated": 0.5, **_IMITATION}
_SPECTRA = {"encoding": "magnitude", "bins": 250}

_SIZE = {"age_months": None, "height_m": None}


def _renamed_capsule(body: str) -> Renamed:
    """Return the change by which the height of walkers' capsules made way for that of bodies."""
    return Renamed(body, "height_m", "capsule_height_m", beside="push_limit_kg")


STEPS: tuple[Step, ...] = (
    Step(
        changes=(
            Renamed("", "warm_start", "init_from"),
            Added("", {"init_encoders": {}, "intrinsic": {"name": "none"}, "team_intrinsic": {}}),
            Added("task", {"separate_finder": False}, name="MultiAgentNav"),
            Added("task", {"sound_path": None}, name="KickTheBall"),
            Added("body", _CALLS),
            Added("team.*.body", _CALLS),
            Added("body", _WALKS, beside="push_limit_kg"),
            Added("team.*.body", _WALKS, beside="push_limit_kg"),
            Added("senses.audio", _SPECTRA),
            Added("team.*.senses.audio", _SPECTRA),
            Replaced("team.*.senses", "extra", before=None, now={}),
            Added("clock", {"sleep_s": math.inf}),
            Added("playground.props.*", {"partition": False}),
            Added("algo.network", _IMAGE_WINDOWS, name="multisense"),
            Added("learner.*.network", _IMAGE_WINDOWS, name="multisense"),
        ),
        state={"intrinsic": {}},
    ),
    Step(
        changes=(
            Added("", {"global_state": False, "demonstrations": None}),
            Added("algo", _PPO, name="ppo"),
            Added("learner.*", _PPO, name="ppo"),
            Added("algo", _SAC, name="sac"),
            Added("learner.*", _SAC, name="sac"),
            Added("algo.network", {"agent_identity": False}, name="multisense"),
            Added("learner.*.network", {"agent_identity": False}, name="multisense"),
        ),
        state={"episodes": {}},
    ),
    Step(
        changes=(
            Added("", {"development": None}),
            *(_renamed_capsule(body) for body in ("body", "team.*.body")),
            *(Added(body, _SIZE) for body in ("body", "team.*.body")),
        )
    ),
    Step(changes=(Grouped("collect"),)),
    Step(
        changes=(
            Added("senses.audio", {"infant_age_months": None}),
            Added("team.*.senses.audio", {"infant_age_months": None}),
        )
    ),
)
"""Entry `n` leads from version `n` to version ``n + 1``."""

CONFIG_VERSION = len(STEPS)
"""Version of the configurations that this code stores."""


def numbered(config: Mapping[str, Any]) -> Plain:
    """Return a configuration as it is stored: with its version."""
    return {KEY: CONFIG_VERSION, **config}


def migrated(stored: Mapping[str, Any]) -> Plain:
    """Return a stored configuration, or a part of one, in the form of this version.

    Args:
        stored: Plain data with their version; without one they have version 0.

    Returns:
        A copy without the version.

    Raises:
        VersionError: If the version is newer than this code, or no version.
    """
    config = deepcopy(dict(stored))
    for step in STEPS[_version(config.pop(KEY, 0)) :]:
        for change in step.changes:
            for node in _nodes(config, change.path):
                change.apply(node)
    return config


def migrated_checkpoint(content: Mapping[str, Any]) -> Plain:
    """Return the content of a checkpoint with configurations and a state of this version.

    Args:
        content: Has `config`, the configuration of the run; `algorithms`, those of its teams; and
            `state`, whose tensors are not copied.

    Raises:
        VersionError: See `migrated`.
    """
    stored = {KEY: content.get(KEY, 0)}
    added: Plain = {}
    for step in STEPS[_version(stored[KEY]) :]:
        added |= step.state
    return {
        **content,
        KEY: CONFIG_VERSION,
        "config": migrated({**content["config"], **stored}),
        "algorithms": migrated({"learner": content["algorithms"], **stored})["learner"],
        "state": {**deepcopy(added), **content["state"]},
    }


def first_form(config: Mapping[str, Any]) -> Plain:
    """Return a configuration of this version as version 0 would have stored it.

    What version 0 cannot express stays as it is. Digests of this form do not change when a step is
    added, as long as the configuration does what it did before.
    """
    first = deepcopy(dict(config))
    for step in reversed(STEPS):
        for change in reversed(step.changes):
            for node in _nodes(first, change.path):
                change.undo(node)
    return first


def _version(stored: object) -> int:
    """Return the version of a configuration, from 0 to `CONFIG_VERSION`."""
    if not isinstance(stored, int) or isinstance(stored, bool) or stored < 0:
        raise VersionError(f"{KEY}={stored!r} is no version: 0 to {CONFIG_VERSION}")
    if stored > CONFIG_VERSION:
        raise VersionError(
            f"{KEY}={stored} is newer than this version of veca_marl, which reads 0 to "
            f"{CONFIG_VERSION}: update veca_marl"
        )
    return stored


def _nodes(node: Any, path: str) -> Iterator[Plain]:
    """Yield the mappings at a path; none where there is nothing, or something else."""
    if not path:
        if isinstance(node, dict):
            yield node
        return
    key, _, rest = path.partition(".")
    for child in _children(node, key):
        yield from _nodes(child, rest)


def _children(node: Any, key: str) -> list[Any]:
    if isinstance(node, list) and key == "*":
        return node
    if not isinstance(node, dict):
        return []
    return list(node.values()) if key == "*" else [node[key]] if key in node else []
