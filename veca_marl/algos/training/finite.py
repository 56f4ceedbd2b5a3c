"""Checks of numbers: NaN and infinity in experience, returns and parameters; ranges of senses."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from tensordict import TensorDictBase

from veca_marl.algos.evaluation.evaluate import Scores
from veca_marl.algos.specs import TeamSpec

_LOG = logging.getLogger(__name__)


class NotFiniteError(RuntimeError):
    """A reward, an observation, an action, a return or a parameter is NaN or infinite."""


def check_batch(batch: TensorDictBase, teams: list[str], frames: int) -> None:
    """Check rewards, reward terms, observations and actions of some experience.

    Args:
        batch: Experience ``(worlds, steps)``.
        teams: The teams whose arrays are checked.
        frames: Training frames before the batch.

    Raises:
        NotFiniteError: With team, term or sense, world and step of the earliest value.
    """
    found = [
        _Found(*_first(array), order, team, name, array)
        for team in teams
        for order, (name, array) in enumerate(_arrays(batch, team))
        if array.is_floating_point() and not torch.isfinite(array).all()
    ]
    if found:
        earliest = min(found, key=lambda one: (one.step, one.world, one.order))
        values = earliest.array[earliest.world, earliest.step]
        raise NotFiniteError(
            f"team {earliest.team!r}: {earliest.name} is {values[~values.isfinite()][0].item()} "
            f"in world {earliest.world} at step {earliest.step} of the batch after {frames} frames"
        )


class _Found(NamedTuple):
    """An array with values that are not finite.

    Attributes:
        step: Step of the earliest of them.
        world: Its world.
        order: Place of the array among those of its team, causes before their consequences.
        team: The team.
        name: What the array holds.
        array: ``(worlds, steps, ...)``.
    """

    step: int
    world: int
    order: int
    team: str
    name: str
    array: torch.Tensor


def _arrays(batch: TensorDictBase, team: str) -> Iterator[tuple[str, torch.Tensor]]:
    """Return names and arrays ``(worlds, steps, ...)``, causes before their consequences."""
    for part, label in ((batch, "sense"), (batch["next"], "next observation of sense")):
        for name, array in sorted(part[team, "observation"].items()):
            yield f"{label} {name!r}", array
    action = batch[team, "action"]
    parts = action.items() if isinstance(action, TensorDictBase) else [("action", action)]
    for name, array in parts:
        yield f"action {name!r}", array
    info = batch["next", team].get("info", None)
    for name, array in sorted(info.items()) if info is not None else ():
        yield f"reward term {name!r}", array
    yield "reward", batch["next", team, "reward"]


def _first(array: torch.Tensor) -> tuple[int, int]:
    """Return step and world of the earliest value that is not finite."""
    wrong = ~array.isfinite().flatten(2).all(-1)
    step, world = wrong.T.nonzero()[0].tolist()
    return step, world


def warn_of_ranges(batch: TensorDictBase, specs: Mapping[str, TeamSpec], frames: int) -> None:
    """Log a warning for each observation that exceeds the range in its spec.

    Args:
        batch: Experience ``(worlds, steps)``.
        specs: Of the teams that are checked.
        frames: Training frames before the batch.
    """
    for team, spec in specs.items():
        for name, layout in spec.observations.items():
            values = batch[team, "observation", name]
            low, high = values.amin().item(), values.amax().item()
            if low < layout.low or high > layout.high:
                _LOG.warning(
                    "team %r: sense %r is between %g and %g in the batch after %d frames; its spec "
                    "says [%g, %g]", team, name, low, high, frames, layout.low, layout.high,
                )  # fmt: skip


def check_scores(scores: Mapping[str, Scores]) -> None:
    """Check the returns and the reward terms of an evaluation.

    Raises:
        NotFiniteError: With team, term and episode.
    """
    for team, score in scores.items():
        for name, sums in {**score.terms, "return": score.returns}.items():
            wrong = np.flatnonzero(~np.isfinite(sums))
            if len(wrong):
                raise NotFiniteError(
                    f"team {team!r}: {name!r} is {sums[wrong[0]]} in episode {wrong[0]} "
                    "of the evaluation"
                )


def check_state(state: Mapping[str, Any], frames: int) -> None:
    """Check that all numbers of what was learnt are finite.

    Args:
        state: Nested tensors and plain data.
        frames: Training frames so far.

    Raises:
        NotFiniteError: With the team and the name of the tensor.
    """
    if found := not_finite(state):
        raise NotFiniteError(f"{found} after {frames} frames: learning has diverged")


def check_stored(state: Mapping[str, Any]) -> None:
    """Check that all numbers of a stored state are finite.

    Args:
        state: Nested tensors and plain data.

    Raises:
        ValueError: With the name of the tensor.
    """
    if found := not_finite(state):
        raise ValueError(found)


def not_finite(state: Mapping[str, Any]) -> str:
    """Return the name of the first tensor with NaN or infinity, and the value; empty if none."""
    for name, tensor in _tensors(state):
        if tensor.is_floating_point() and not (finite := tensor.isfinite()).all():
            return f"{name} is {tensor[~finite][0].item()}"
    return ""


def _tensors(state: Any, name: str = "") -> Iterator[tuple[str, torch.Tensor]]:
    if isinstance(state, torch.Tensor):
        yield name, state
    elif isinstance(state, Mapping):
        for key, entry in state.items():
            yield from _tensors(entry, f"{name}.{key}".lstrip("."))
    elif isinstance(state, list | tuple):
        for index, entry in enumerate(state):
            yield from _tensors(entry, f"{name}[{index}]")
