"""The weight of the entropy bonus: one number, or one for each part of the action."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from veca_marl.algos.specs import PLAIN, action_key


def check_entropy_coefficient(coefficient: object) -> None:
    """Check that it is a finite number, or a mapping from names of parts to finite numbers.

    Raises:
        ValueError: If it is not.
    """
    values = list(coefficient.values()) if isinstance(coefficient, Mapping) else [coefficient]
    if not values or not all(_is_number(value) for value in values):
        raise ValueError(
            "algo.entropy_coefficient must be a number, or a mapping from each part of the action "
            f"to a number, got {coefficient!r}"
        )


def entropy_weights(
    team: str, parts: Sequence[str], coefficient: float | Mapping[str, float]
) -> float | dict[Any, float]:
    """Return the coefficient as TorchRL's PPO losses take it.

    Args:
        team: Name of the team.
        parts: Names of the parts of its action.
        coefficient: A number, or a number for each part.

    Returns:
        A number; for an action of several parts and a mapping, a mapping from the keys under which
        `CompositeDistribution` writes the entropies of the parts.

    Raises:
        ValueError: If the mapping has other names than the parts.
    """
    if not isinstance(coefficient, Mapping):
        return float(coefficient)
    if set(coefficient) != set(parts):
        raise ValueError(
            f"algo.entropy_coefficient of team {team!r}: got a weight for {sorted(coefficient)}, "
            f"the parts of its action are {sorted(parts)}"
        )
    if set(parts) == {PLAIN}:
        return float(coefficient[PLAIN])
    keys = {part: action_key(team, part) for part in parts}
    return {
        (*key[:-1], f"{key[-1]}_entropy"): float(coefficient[part]) for part, key in keys.items()
    }


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)
