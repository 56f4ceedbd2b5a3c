"""What ``python -m veca_marl.train --help`` prints: examples, presets and keys, on one screen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import PurePosixPath
from textwrap import wrap
from typing import Any

from hydra.core.config_store import ConfigStore

from veca_marl.config.compose import load_config_plugins
from veca_marl.config.overrides import conf_dirs, plugins_in
from veca_marl.config.root import Config
from veca_marl.envs.core.task import TASKS

WIDTH = 80
_NO_CHOICE = ("schema", "dataset", "hydra")  # parts of presets; presets of others

DESCRIPTION = """Train on a task, continue a run, or sweep over values:

  python -m veca_marl.train +task=KickTheBall senses/audio=mono seed=1
  python -m veca_marl.train +task=PushOut2v2 algo=mappo opponent.blue=random
  python -m veca_marl.train resume=runs/KickTheBall/...
  python -m veca_marl.train -m +task=KickTheBall senses/audio=hrtf,mono seed=1,2
  python -m veca_marl.train -m +experiment=default_seeds

Presets, as GROUP=NAME (+ before task and experiment):
"""


def training_help(overrides: Sequence[str] = ()) -> str:
    """Return the text, with the presets of the plug-ins: those installed, and those named.

    Raises:
        ConfigError: If a plug-in cannot be loaded.
    """
    load_config_plugins(plugins_in(overrides))
    groups = {**_presets(), "task": sorted(TASKS)}
    lines = [line for group in sorted(groups) for line in _wrapped(group, groups[group])]
    keys = ", ".join(field.name for field in fields(Config))
    end = [
        *wrap(f"Values, as KEY=VALUE, such as algo.gamma=0.95: of {keys}.", WIDTH),
        "All of them: --cfg job; what they mean: docs/reference/configuration.md.",
    ]
    return "\n".join([DESCRIPTION, *lines, "", *end, ""])


def _presets() -> dict[str, list[str]]:
    """Return the presets of each group that a user chooses from: files, and stored ones."""
    paths = [
        PurePosixPath(file.relative_to(folder).as_posix())
        for folder in conf_dirs()
        for file in folder.rglob("*.yaml")
    ]
    found: dict[str, set[str]] = {}
    for path in [*paths, *_stored(ConfigStore.instance().repo, PurePosixPath())]:
        group = path.parent.as_posix()
        if path.parts[0] not in _NO_CHOICE and group != ".":
            found.setdefault(group, set()).add(path.stem)
    return {group: sorted(names) for group, names in found.items()}


def _stored(repo: dict[str, Any], folder: PurePosixPath) -> Iterator[PurePosixPath]:
    """Yield the paths of what was stored without a file."""
    for name, content in repo.items():
        if isinstance(content, dict):
            yield from _stored(content, folder / name)
        else:
            yield folder / name


def _wrapped(group: str, names: list[str]) -> list[str]:
    text = f"{group}: {', '.join(names)}"
    return wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)
