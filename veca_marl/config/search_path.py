"""Hydra finds the configuration files of plug-ins beside those of the project."""

from __future__ import annotations

from pathlib import Path

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin

from veca_marl.conf_dir import conf_dir
from veca_marl.plugins import PLUGINS, PluginError


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
