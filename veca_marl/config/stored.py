"""The configuration stored with a run: read with its types, and changed by overrides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from veca_marl.algos.algorithm import ALGORITHMS
from veca_marl.algos.intrinsic.intrinsic_reward import INTRINSICS, NONE, IntrinsicCfg
from veca_marl.algos.networks.factory import NETWORKS
from veca_marl.config.compose import check_parts, compose_node, load_config_plugins
from veca_marl.config.errors import ConfigError, one_line
from veca_marl.config.overrides import check_group_values, conf_dirs, parse
from veca_marl.config.root import body_types, root_schema
from veca_marl.envs.core.game_cfg import TeamCfg
from veca_marl.envs.core.task import find_task
from veca_marl.migrations import migrated
from veca_marl.override_text import is_within, normalised
from veca_marl.plugins import PLUGINS
from veca_marl.sim.body import BODIES
from veca_marl.sim.physics import PLAYGROUND_GENERATORS

GAME_KEYS = (
    *("body", "clock", "development", "eval", "opponent", "playground", "senses", "task", "team"),
)
"""Keys of the root that can be changed when what a run has learnt is played again."""


def body_names(node: DictConfig) -> dict[str, str]:
    """Return the registered name of each body in a configuration, by its key.

    The stored file contains the parameters of a body, not its class; these names are stored with
    it and given to `typed`.
    """
    names: dict[Any, str] = {kind: name for name, kind in body_types().items()}
    bodies = {"body": node.body}
    bodies |= {f"team.{team}.body": cfg.get("body") for team, cfg in node.team.items()}
    return {
        key: names[OmegaConf.get_type(body)] for key, body in bodies.items() if body is not None
    }


def typed(stored: Mapping[str, Any], bodies: Mapping[str, str]) -> DictConfig:
    """Return a stored configuration with the types that it had.

    Args:
        stored: The content of `config.yaml` of a run.
        bodies: What `body_names` returned for the configuration.

    Raises:
        ConfigError: If an entry has no counterpart in this version, a newer version has stored it,
            or a plug-in is not loaded.
    """
    _check_plugins(stored.get("plugins", []))
    try:
        config = migrated(stored)
        _check_groups(config)
        _check_bodies(config, bodies)
        node = root_schema()
        node.task = OmegaConf.structured(find_task(config["task"]["name"]).cfg_type())
        node.algo = _algorithm(config["algo"])
        for team, algo in config["learner"].items():
            node.learner[team] = _algorithm(algo)
        node.intrinsic = _intrinsic(config["intrinsic"])
        for team, intrinsic in config["team_intrinsic"].items():
            node.team_intrinsic[team] = _intrinsic(intrinsic)
        for team in config["team"]:
            node.team[team] = OmegaConf.structured(TeamCfg)
        if "generator" in config["playground"]:
            generator = PLAYGROUND_GENERATORS.find(config["playground"]["generator"])
            node.playground = OmegaConf.structured(generator)
        for key, name in bodies.items():
            OmegaConf.update(node, key, BODIES.find(name).cfg_type())
        return cast(DictConfig, OmegaConf.merge(node, OmegaConf.create(config)))
    except (OmegaConfBaseException, ValueError, TypeError, AttributeError) as error:
        raise ConfigError(f"stored configuration: {one_line(error)}") from error


_GROUPS = ("task", "algo", "intrinsic", "playground", "learner", "team_intrinsic", "team")


def _check_groups(config: Mapping[str, Any]) -> None:
    """Check that what decides the types of the others is there, and of the right kind.

    Raises:
        ConfigError: If it is not; the message names the key.
    """
    for group in _GROUPS:
        if not isinstance(config.get(group), dict):
            raise ConfigError(f"{group} is no group of values, but {config.get(group)!r:.80}")
    named = {key: config[key] for key in ("task", "algo", "intrinsic")}
    for group in ("learner", "team_intrinsic"):
        named |= {f"{group}.{team}": entry for team, entry in config[group].items()}
    for key, entry in list(named.items()):
        if isinstance(entry, dict) and "network" in entry:
            named[f"{key}.network"] = entry["network"]
    named = {f"{key}.name": _name(entry) for key, entry in named.items()}
    if "generator" in config["playground"]:
        named["playground.generator"] = config["playground"]["generator"]
    for key, name in named.items():
        if not isinstance(name, str):
            raise ConfigError(f"{key} is no name, but {name!r:.80}")


def _name(entry: Any) -> Any:
    return entry.get("name") if isinstance(entry, dict) else None


def _check_bodies(config: Mapping[str, Any], bodies: Mapping[str, str]) -> None:
    """Check that names of bodies belong to bodies of the configuration.

    Raises:
        ConfigError: If one does not.
    """
    keys = ["body", *(f"team.{team}.body" for team in config["team"])]
    if unknown := sorted(set(bodies) - set(keys)):
        raise ConfigError(f"there is no body {unknown[0]!r}; choices: {', '.join(keys)}")


def _check_plugins(names: Any) -> None:
    """Check that the plug-ins of a stored configuration are loaded.

    They are never imported because a run names them: the run may come from someone else.

    Raises:
        ConfigError: If one is not, or the entry is no list of names.
    """
    load_config_plugins([])  # those that are installed
    is_list = isinstance(names, Sequence) and not isinstance(names, str)
    if not is_list or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"plugins={names!r} is no list of names")
    if missing := [name for name in names if name not in PLUGINS]:
        raise ConfigError(
            f"this run needs the plug-in {', '.join(missing)}; its code is executed only on "
            f"request: add 'plugins=[{','.join(names)}]'"
        )


def _algorithm(stored: Mapping[str, Any]) -> Any:
    node = OmegaConf.structured(ALGORITHMS.find(stored["name"]).cfg_type)
    if "network" in node:
        if "network" not in stored:
            raise ConfigError(f"the algorithm {stored['name']} has no network")
        node.network = OmegaConf.structured(NETWORKS.find(stored["network"]["name"]).cfg_type)
    return node


def _intrinsic(stored: Mapping[str, Any]) -> Any:
    none = stored["name"] == NONE
    return OmegaConf.structured(IntrinsicCfg if none else INTRINSICS.find(stored["name"]).cfg_type)


def change(node: DictConfig, overrides: Sequence[str], allowed: Sequence[str] = GAME_KEYS) -> None:
    """Apply overrides to a typed configuration; everything else stays as it is.

    The choice of a preset, such as ``senses/audio=mono``, replaces the values of its group.

    Args:
        node: The configuration; it is changed.
        overrides: In Hydra's grammar.
        allowed: Keys, or parts of the configuration, that may be changed.

    Raises:
        ConfigError: If another key is to be changed, or a choice or a value does not exist.
    """
    for override in parse(normalised(overrides)):
        path = (override.package or str(override.key_or_group).replace("/", ".")).split(".")
        if path == ["plugins"]:  # loaded before the configuration was read
            continue
        if path == ["task"]:
            _require_same_task(node, override)
            continue
        if not is_within(".".join(path), allowed):
            choices = ", ".join("task.FIELD" if key == "task" else key for key in allowed)
            raise ConfigError(f"{override.input_line}: of a run, only {choices} can be changed")
        if path[0] == "team" and len(path) > 1 and path[1] not in node.team:
            node.team[path[1]] = OmegaConf.structured(TeamCfg)
        try:
            check_group_values([str(override.input_line)])
            check_parts(node, [str(override.input_line)])
            _apply(node, override)
        except OmegaConfBaseException as error:
            raise ConfigError(one_line(error)) from error


def _require_same_task(node: DictConfig, override: Override) -> None:
    if override.value() != node.task.name:
        raise ConfigError(f"{override.input_line}: it is a run of {node.task.name}")


def _apply(node: DictConfig, override: Override) -> None:
    key = str(override.key_or_group)
    if _is_group(key) and isinstance(override.value(), str):
        _choose_preset(node, override)
    elif override.is_delete():
        _delete(node, key)
    else:
        OmegaConf.update(node, key, override.value(), merge=True, force_add=override.is_add())


def _is_group(key: str) -> bool:
    return any((folder / key).is_dir() for folder in conf_dirs())


def _choose_preset(node: DictConfig, override: Override) -> None:
    key = override.package or str(override.key_or_group).replace("/", ".")
    composed = compose_node([f"+task={node.task.name}", str(override.input_line)])
    preset = OmegaConf.select(composed, key)
    with open_dict(node):
        OmegaConf.update(node, key, preset, merge=False)


def _delete(node: DictConfig, key: str) -> None:
    parent, _, name = key.rpartition(".")
    owner = OmegaConf.select(node, parent) if parent else node
    if not isinstance(owner, DictConfig) or name not in owner:
        raise ConfigError(f"~{key}: there is nothing to delete")
    with open_dict(owner):
        del owner[name]
