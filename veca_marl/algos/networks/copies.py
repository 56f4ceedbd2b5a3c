"""Copies of networks from other runs, and what has to be equal in both."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from veca_marl.algos.algorithm import Algorithm
from veca_marl.algos.networks.factory import NetworkCfg
from veca_marl.algos.sense_encoders import copy_parameters


def check_same_network(cfg: NetworkCfg, stored: NetworkCfg, left_out: Collection[str] = ()) -> None:
    """Check that two configurations describe the same parameters.

    Args:
        cfg: A configuration.
        stored: That of the run to copy from.
        left_out: Fields that may differ.

    Raises:
        ValueError: If they differ; the message names the fields.
    """
    left_out = {*cfg.not_parameters, *left_out}
    check_same_settings("network", vars(cfg), vars(stored), left_out)


def check_same_settings(
    what: str,
    new: Mapping[str, Any],
    old: Mapping[str, Any],
    left_out: Collection[str] = (),
    hint: str = "",
) -> None:
    """Check that two runs have the same settings.

    Args:
        what: What they describe.
        new: Settings of this run by name.
        old: Those of the stored run.
        left_out: Names that may differ.
        hint: End of the message.

    Raises:
        ValueError: If they differ; the message names the settings.
    """
    differing = [
        f"{name}={old.get(name, 'absent')} in the stored run, {new.get(name, 'absent')} in this one"
        for name in {**new, **old}
        if name not in left_out and old.get(name) != new.get(name)
    ]
    if differing:
        raise ValueError(f"another {what}: {'; '.join(differing)}{hint}")


def copy_actor(here: Algorithm, other: Algorithm) -> None:
    """Copy the actor of another algorithm, with or without a `NetworkCfg`.

    Raises:
        ValueError: If the parameters do not fit or would be another function.
    """
    cfg, stored = here.network_cfg, other.network_cfg
    if isinstance(cfg, NetworkCfg) and isinstance(stored, NetworkCfg):
        check_same_network(cfg, stored, cfg.critics_only)
    new, old = ({"algo.policy_hidden": list(each.policy_hidden)} for each in (here, other))
    check_same_settings("actor", new, old, hint="; actors of PPO have []")
    copy_parameters(here.actor, other.actor)
