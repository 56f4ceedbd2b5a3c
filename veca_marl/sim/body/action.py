"""Checks of actions, which map names of action parts to values, and the part `voice`."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.sense import ArraySpec, discrete_spec
from veca_marl.sim.sound import Call

Action = Mapping[str, NDArray[Any]]


def checked_action(specs: Mapping[str, ArraySpec], action: Mapping[str, Any]) -> Action:
    """Return all parts of an action as arrays.

    Args:
        specs: The parts that are needed, by name.
        action: A value for each of them.

    Raises:
        ValueError: If the action is no mapping, if a part is missing or unknown, or if a value has
            the wrong shape or is out of its range. The message names part, value and choices.
    """
    if not isinstance(action, Mapping):
        raise ValueError(f"action {action!r} is not a mapping; it needs the parts {list(specs)}")
    if action.keys() != specs.keys():
        raise ValueError(f"action has the parts {list(action)}; it needs {list(specs)}")
    return {part: _checked(part, spec, action[part]) for part, spec in specs.items()}


def _checked(part: str, spec: ArraySpec, value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    if spec.is_discrete:
        _check_choice(part, spec, array)
    else:
        _check_vector(part, spec, array)
    return array


def _check_choice(part: str, spec: ArraySpec, value: NDArray[Any]) -> None:
    if value.shape != () or value.dtype.kind not in "iu" or not 0 <= value <= spec.high:
        choices = dict(enumerate(spec.names)) or f"0 to {spec.high:.0f}"
        raise ValueError(f"action part {part!r} is {value!r}, not one of {choices}")


def _check_vector(part: str, spec: ArraySpec, value: NDArray[Any]) -> None:
    if value.shape != spec.shape or value.dtype.kind not in "fiu":
        raise ValueError(
            f"action part {part!r} is {value.dtype} of shape {value.shape}, not numbers of shape "
            f"{spec.shape}{_listed(spec.names)}"
        )
    # written so that a NaN is out of range
    inside = (value >= spec.low) & (value <= spec.high)
    if not inside.all():
        index = int(np.flatnonzero(~inside)[0])
        name = spec.names[index] if spec.names else f"[{index}]"
        raise ValueError(
            f"action part {part!r}: {name} is {value.flat[index]}, "
            f"not in [{spec.low:g}, {spec.high:g}]"
        )


def _listed(names: tuple[str, ...]) -> str:
    """Return the names of a short vector for a message."""
    return f" ({', '.join(names)})" if 0 < len(names) <= 8 else ""


VOICE = "voice"  # the part's name


class VoiceKind(Enum):
    """Whether a body's action has a part `voice`. `make_sound` works with either."""

    silent = "silent"
    calls = "calls"


def voice_spec(kind: VoiceKind) -> dict[str, ArraySpec]:
    """Return the part of the action that chooses a call; empty for a body that has none."""
    if kind is VoiceKind.silent:
        return {}
    return {VOICE: discrete_spec(tuple(call.name for call in Call))}
