"""Actions outside the simulator: plain arrays or mappings of parts, and those of scripted teams.

A body's action is a mapping from part names to arrays (`Body.action_spec`). Libraries and users
give the plain array for a body with a single part; these functions convert between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.task import Player
from veca_marl.sim.spec import ArraySpec

ActionSpec = Mapping[str, ArraySpec]
Parts = dict[str, NDArray[Any]]


def only_part(spec: ActionSpec) -> str | None:
    """Return the name of the single part of an action; None if there are several."""
    return next(iter(spec)) if len(spec) == 1 else None


def to_parts(spec: ActionSpec, action: Any) -> Mapping[str, Any]:
    """Return an action as a mapping of parts; the body checks names and values.

    Args:
        spec: The parts of the body's action.
        action: A mapping of parts, or the plain array of a body with one part.

    Raises:
        ValueError: If an action that has several parts is not a mapping.
    """
    if isinstance(action, Mapping):
        return action
    part = only_part(spec)
    if part is None:
        raise ValueError(f"action {action!r} is not a mapping; it needs the parts {list(spec)}")
    return {part: action}


def from_parts(parts: Mapping[str, Any]) -> Any:
    """Return the plain array of an action with one part; a dict of the parts if it has several."""
    if len(parts) == 1:
        (array,) = parts.values()
        return array
    return dict(parts)


def random_action(spec: ActionSpec, rng: np.random.Generator) -> Parts:
    """Draw all parts of an action uniformly, in their order."""
    return {part: _random_part(one, rng) for part, one in spec.items()}


def _random_part(spec: ArraySpec, rng: np.random.Generator) -> NDArray[Any]:
    if spec.is_discrete:
        return np.asarray(rng.integers(int(spec.high) + 1), spec.dtype)
    return rng.uniform(spec.low, spec.high, spec.shape).astype(spec.dtype)


def play_script(
    script: Script,
    player: Player,
    expert_command: Callable[[Player], Any],
    rng: np.random.Generator,
) -> None:
    """Set the action of one player for the next step.

    Args:
        script: How the action is chosen.
        player: The player.
        expert_command: Returns the command of the player's expert; called for `Script.expert` only.
        rng: Random generator of the game.
    """
    if script is Script.idle:
        player.body.rest()
    elif script is Script.random:
        player.body.act(random_action(player.body.action_spec, rng))
    else:
        player.body.act(player.body.encode(expert_command(player)))
