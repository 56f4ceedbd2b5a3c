"""The types behind the configuration files, as Hydra stores them.

Each registered task has a schema. A task without a file `conf/task/MyTask.yaml` has an entry of the
group `task` as well, so that ``+task=MyTask`` takes the defaults of its dataclass.
"""

from __future__ import annotations

from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, OmegaConf

from veca_marl.algos.algorithm import ALGORITHMS
from veca_marl.algos.intrinsic.intrinsic_reward import INTRINSICS, NONE, IntrinsicCfg
from veca_marl.algos.networks.factory import NETWORKS
from veca_marl.config.root import Config
from veca_marl.config.search_path import conf_dirs
from veca_marl.envs.core.task import TASKS
from veca_marl.sim.body import BODIES, BodyCfg
from veca_marl.sim.physics import PLAYGROUND_GENERATORS

BY_TEAM = ("team", "opponent", "init_from", "init_encoders", "learner", "team_intrinsic")
"""Keys of the root that have the names of teams as their keys."""


def register_schemas() -> None:
    """Store the schemas of the root and of all registered entries, present and later ones."""
    store = ConfigStore.instance()
    store.store(name="schema", node=root_schema())
    _store_named("intrinsic", NONE, IntrinsicCfg)
    ALGORITHMS.listen(_store_algorithm)
    NETWORKS.listen(_store_network)
    INTRINSICS.listen(_store_intrinsic)
    BODIES.listen(_store_body)
    PLAYGROUND_GENERATORS.listen(_store_playground)
    TASKS.listen(_store_task_schema)


def root_schema() -> Any:
    """Return `Config` as a node that takes any team's name where teams are keys."""
    schema = OmegaConf.structured(Config)
    for key in BY_TEAM:
        OmegaConf.set_struct(schema[key], False)
    return schema


def body_types() -> dict[str, type[BodyCfg]]:
    """Return the dataclass of each kind of body."""
    return {name: body.cfg_type for name, body in BODIES.items()}


def store_tasks_without_file() -> None:
    """Store a group entry for each registered task that has no file `task/<name>.yaml`."""
    store = ConfigStore.instance()
    for name in TASKS:
        if not any((folder / "task" / f"{name}.yaml").is_file() for folder in conf_dirs()):
            entry = {"defaults": [{"/schema/task@task": name}, "_self_"], "task": {"name": name}}
            store.store(group="task", name=name, node=entry, package="_global_")


def _store_algorithm(name: str) -> None:
    """Store the schema of an algorithm; its network is chosen in the group ``algo/network``.

    An algorithm without a file ``algo/<name>.yaml`` has an entry of the group ``algo`` as well.
    """
    store = ConfigStore.instance()
    node = OmegaConf.structured(ALGORITHMS[name].cfg_type)
    defaults: list[Any] = [{"/schema/algo@_here_": name}]
    if "network" in node:
        defaults.append({"network": node.network.name})
        node.network = MISSING
    store.store(group="schema/algo", name=name, node=node)
    if not any((folder / "algo" / f"{name}.yaml").is_file() for folder in conf_dirs()):
        store.store(group="algo", name=name, node={"defaults": [*defaults, "_self_"]})


def _store_network(name: str) -> None:
    ConfigStore.instance().store(group="algo/network", name=name, node=NETWORKS[name].cfg_type)


def _store_intrinsic(name: str) -> None:
    """Store the schema of an intrinsic reward; without a file it can be chosen as well."""
    _store_named("intrinsic", name, INTRINSICS[name].cfg_type)


def _store_body(name: str) -> None:
    """Store the schema of a body; without a file it can be chosen as well."""
    _store_named("body", name, BODIES[name].cfg_type)


def _store_playground(name: str) -> None:
    """Store the schema of a generated playground; without a file it can be chosen as well."""
    _store_named("playground", name, PLAYGROUND_GENERATORS[name])


def _store_named(group: str, name: str, cfg_type: type) -> None:
    """Store a schema, and an entry of the group if there is no file ``<group>/<name>.yaml``."""
    store = ConfigStore.instance()
    store.store(group=f"schema/{group}", name=name, node=cfg_type)
    if not any((folder / group / f"{name}.yaml").is_file() for folder in conf_dirs()):
        entry = {"defaults": [{f"/schema/{group}@_here_": name}, "_self_"]}
        store.store(group=group, name=name, node=entry)


def _store_task_schema(name: str) -> None:
    ConfigStore.instance().store(group="schema/task", name=name, node=TASKS[name].cfg_type())
