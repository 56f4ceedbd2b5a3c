"""The arms of an experiment, composed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import yaml
from omegaconf import OmegaConf

from veca_marl.config import Config, ConfigError, compose_node, to_config
from veca_marl.config.arms import check_contradictions
from veca_marl.config.stored import body_names
from veca_marl.reports.budget import FrameBudget
from veca_marl.sweeps.body_kinds import former_kinds, with_body_kinds
from veca_marl.sweeps.former import former_values


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes:
        name: Its name.
        cfg: Its configuration.
        plain: The same as stored with a run, with the kinds of bodies (`with_body_kinds`).
        former: Values of keys that a stored run may be too old to have, see `former_values`.
    """

    name: str
    cfg: Config
    plain: dict[str, Any]
    former: dict[str, Any]

    @property
    def budget(self) -> FrameBudget:
        """Frames that its runs are asked to have."""
        return FrameBudget.of(self.plain)


def compose_arms(overrides: Sequence[str]) -> list[Arm]:
    """Return all arms of the experiment that `overrides` choose.

    Raises:
        ConfigError: If they choose none, or one without arms.
    """
    experiment = compose_node(overrides).experiment
    if experiment.name is None:
        raise ConfigError("no experiment with arms: add +experiment=NAME")
    if not experiment.arms or not experiment.seeds:
        raise ConfigError(f"experiment {experiment.name} has no arms or no seeds")
    return [_compose_arm(overrides, str(name), list(own)) for name, own in experiment.arms.items()]


def _compose_arm(overrides: Sequence[str], name: str, own: Sequence[str]) -> Arm:
    check_contradictions(name, own, overrides)
    node = compose_node([*overrides, f"experiment.arm={name}", *own])
    plain = cast(dict[str, Any], yaml.safe_load(OmegaConf.to_yaml(node, resolve=True)))
    kinds = body_names(node)
    former = former_values(node) | former_kinds(kinds)
    return Arm(name, to_config(node), with_body_kinds(plain, kinds), former)
