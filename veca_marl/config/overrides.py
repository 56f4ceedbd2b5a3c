"""Overrides as text, and the files and names of presets that they may choose."""

from __future__ import annotations

import os
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.search_path_plugin import SearchPathPlugin

from veca_marl.config.errors import ConfigError, one_line
from veca_marl.override_text import quoted
from veca_marl.plugins import PLUGINS, PluginError, conf_dir


def parse(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides by Hydra's grammar.

    Raises:
        ConfigError: If one does not follow the grammar.
    """
    parser = OverridesParser.create()
    return [_parse(parser, text) for text in overrides]


def _parse(parser: OverridesParser, text: str) -> Override:
    try:
        return parser.parse_override(text)
    except (HydraException, ValueError) as error:  # also of a number that Python does not read
        key, equals, value = text.partition("=")
        advice = "; words are KEY=VALUE" if not equals else ""
        if equals and value:  # with the marks that a shell leaves
            advice = f'; quoted it is a text: "{key}={quoted(value)}"'
        reason = one_line(error).partition(" See https://hydra.cc")[0]
        raise ConfigError(f"{text} cannot be read as an override ({reason}){advice}") from error


def root_of(override: Override) -> str:
    """Return the first part of the key of an override: ``senses`` of ``senses/audio=mono``."""
    return re.split(r"[./]", override.key_or_group, maxsplit=1)[0]


def plugins_in(overrides: Sequence[str]) -> list[str]:
    """Return the packages that `plugins=[...]` names.

    Raises:
        ConfigError: If its value is not a list of names.
    """
    texts = [text for text in overrides if text.lstrip("+").startswith("plugins=")]
    names: list[str] = []
    for override in parse(texts):
        value = override.value()
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise ConfigError(f"{override.input_line}: expected names: plugins=[my_package]")
        names += value
    return names


class PluginSearchPath(SearchPathPlugin):
    """Appends the configuration folder of each loaded plug-in to Hydra's search path."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """See `SearchPathPlugin`."""
        for plugin in PLUGINS.values():
            if plugin.conf is not None:
                search_path.append(provider=plugin.name, path=f"file://{plugin.conf}")


def register_search_path() -> None:
    """Register `PluginSearchPath` with Hydra; calling it again has no effect."""
    Plugins.instance().register(PluginSearchPath)


def conf_dirs() -> list[Path]:
    """Return the configuration folders of the project and of the loaded plug-ins."""
    own = [plugin.conf for plugin in PLUGINS.values() if plugin.conf is not None]
    return [conf_dir(), *own]


def state_of_sources() -> Hashable:
    """Return what differs once a configuration file or a stored schema has changed."""
    files = tuple(state for folder in conf_dirs() for state in _states_of_files(folder))
    return files, tuple(_stored_nodes(ConfigStore.instance().repo))


def _states_of_files(folder: Path) -> Iterator[tuple[str, int, int]]:
    """Yield path, time of the last change in ns, and bytes of each configuration file."""
    for where, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(where, name)
            if name.endswith(".yaml") and os.path.isfile(path):  # editors leave broken links
                status = os.stat(path)
                yield path, status.st_mtime_ns, status.st_size


class _Identity:
    """Equals another one of the same object, which it keeps, so that no other object has its id."""

    def __init__(self, of: object) -> None:
        self._of = of

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and self._of is other._of

    def __hash__(self) -> int:
        return id(self._of)


def _stored_nodes(group: Mapping[str, Any]) -> Iterator[tuple[str, _Identity]]:
    """Yield name and identity of each node that is stored with Hydra."""
    for name, stored in group.items():
        if isinstance(stored, Mapping):
            yield from _stored_nodes(stored)
        else:
            yield name, _Identity(stored)


def check_configuration_files() -> None:
    """Refuse a configuration file that two plug-ins, or a plug-in and the project, contain.

    Raises:
        PluginError: Naming both files.
    """
    provided: dict[str, Path] = {}
    if len(conf_dirs()) < 2:
        return
    for folder in conf_dirs():
        for path in sorted(folder.rglob("*.yaml")):
            name = path.relative_to(folder).as_posix()
            if name in provided:
                raise PluginError(f"{name} is defined twice: by {provided[name]} and {path}")
            provided[name] = path


def check_group_values(words: Sequence[str]) -> None:
    """Check that overrides of groups, such as ``senses/vision``, give the name of a preset.

    Hydra answers another value with an error of its own code.

    Args:
        words: Overrides and flags.

    Raises:
        ConfigError: If one does not; the message lists the presets.
    """
    of_groups = [word for word in words if word[:1] not in "~-" and presets_of(_group(word))]
    for override in parse(of_groups):
        if override.is_sweep_override():
            continue
        value = override.value()
        names = value if isinstance(value, list) else [value]
        if not all(isinstance(name, str) for name in names):
            raise ConfigError(
                f"{override.input_line}: must be the name of a preset; choices: "
                f"{', '.join(presets_of(override.key_or_group))}"
            )


def presets_of(group: str) -> list[str]:
    """Return the names in a group; none if there is no such group."""
    folders = [folder / group for folder in conf_dirs() if group and (folder / group).is_dir()]
    return sorted({file.stem for folder in folders for file in folder.glob("*.yaml")})


def _group(word: str) -> str:
    """Return the key of an override without its package; nothing for other words."""
    key, equals, _ = word.lstrip("+").partition("=")
    return key.partition("@")[0] if equals else ""
