"""The arms of an experiment, composed, and the evaluations that their numbers of frames ask for.

A run ends with the first batch at or after ``total_frames``. One that was started with a larger
number, or continued to it, has later evaluations: they are not compared with those of other runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, cast

import yaml
from omegaconf import DictConfig, OmegaConf

from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.config import Config, ConfigError, compose_node, to_config
from veca_marl.config.experiment import check_contradictions
from veca_marl.config.stored import body_names
from veca_marl.sweeps.names import RUNS, arm_of, combinations, fixed_in, folder_of, key_of
from veca_marl.sweeps.run_state import RunState, with_body_kinds


@dataclass(frozen=True)
class FrameBudget:
    """Frames that the runs of an arm are asked to have.

    Attributes:
        frames: ``total_frames`` of the arm.
        batch: Frames in a batch; a run may end with up to ``batch - 1`` frames more than asked.
    """

    frames: int
    batch: int

    @classmethod
    def of(cls, config: Mapping[str, Any]) -> FrameBudget:
        """Return the budget of an arm, from its configuration as plain data."""
        return cls(int(config["total_frames"]), CollectCfg(**config["collect"]).frames)

    def includes(self, frames: int) -> bool:
        """Return whether a run on this budget can have so many frames."""
        return frames < self.frames + self.batch

    def final(self, evaluated: Iterable[int]) -> int | None:
        """Return the frames of the final evaluation; None if the run was not evaluated there.

        Args:
            evaluated: Frames of training before each evaluation of the policy.
        """
        reached = (at for at in evaluated if at >= self.frames and self.includes(at))
        return min(reached, default=None)

    def counts(self, state: RunState, evaluated: Iterable[int]) -> bool:
        """Return whether a run has a final score.

        Args:
            state: How far the run has come; in a stored table, on the budget of that time.
            evaluated: As for `final`.
        """
        evaluated = list(evaluated)
        if self.final(evaluated) is not None:
            # with later evaluations it has passed the budget, whether it goes on or not
            return state in (RunState.finished, RunState.cut) or self._is_exceeded(evaluated)
        return state is RunState.cut and not self._is_exceeded(evaluated)

    def remark(self, evaluated: Iterable[int]) -> str:
        """Return what a reader has to know of a run with more frames; empty for other runs."""
        evaluated = list(evaluated)
        if not self._is_exceeded(evaluated):
            return ""
        more = f"{max(evaluated)} frames, more than the {self.frames} asked for"
        final = self.final(evaluated)
        if final is None:
            return f"not counted: {more}, and no evaluation at {self.frames}"
        return f"{more}; its final score is that at {final}"

    def _is_exceeded(self, evaluated: Iterable[int]) -> bool:
        return not all(map(self.includes, evaluated))


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes:
        name: Its name.
        cfg: Its configuration.
        plain: The same as stored with a run, with the kinds of bodies (`with_body_kinds`).
    """

    name: str
    cfg: Config
    plain: dict[str, Any]

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
        raise ConfigError(
            "no experiment with arms: add +experiment=NAME, or, for a sweep without one, -m and "
            "all words of its command"
        )
    if not experiment.arms or not experiment.seeds:
        raise ConfigError(f"experiment {experiment.name} has no arms or no seeds")
    return [_compose_arm(overrides, str(name), list(own)) for name, own in experiment.arms.items()]


def compose_sweep(overrides: Sequence[str]) -> list[Arm]:
    """Return the combinations of values of a sweep without an experiment, as arms.

    Args:
        overrides: Those of ``train -m``; some list values.

    Raises:
        ConfigError: If a combination is impossible.
    """
    combined, seeds = combinations(overrides)
    fixed = [text for text in fixed_in(overrides) if key_of(text) != "seed"]
    arms = {arm_of(varied): varied for varied in combined}
    composed = {name: compose_node([*fixed, *varied]) for name, varied in arms.items()}
    return [
        Arm(name, _with_experiment(to_config(node), fixed, arms, seeds), _stored(node))
        for name, node in composed.items()
    ]


def _with_experiment(
    cfg: Config, fixed: Sequence[str], arms: Mapping[str, list[str]], seeds: Sequence[int]
) -> Config:
    """Return a configuration with a sweep in place of its experiment."""
    name = folder_of(fixed).relative_to(RUNS).as_posix()
    experiment = copy(cfg.experiment)  # its names are those of folders, which are checked no more
    experiment.name, experiment.arms = name, dict(arms)
    experiment.seeds = list(seeds) or [cfg.seed]
    return replace(cfg, experiment=experiment)


def _stored(node: DictConfig) -> dict[str, Any]:
    """Return a configuration as it is stored with a run."""
    plain = cast(dict[str, Any], yaml.safe_load(OmegaConf.to_yaml(node, resolve=True)))
    return with_body_kinds(plain, body_names(node))


def _compose_arm(overrides: Sequence[str], name: str, own: Sequence[str]) -> Arm:
    check_contradictions(name, own, overrides)
    node = compose_node([*overrides, f"experiment.arm={name}", *own])
    return Arm(name, to_config(node), _stored(node))
