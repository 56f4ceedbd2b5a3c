"""Shared parts of navigation tasks: free places, visibility, the paper's helper reward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.scene import Scene
from veca_marl.sim.geometry.vectors import horizontal_distance
from veca_marl.sim.physics.playground import RoomCfg
from veca_marl.sim.physics.props import Prop
from veca_marl.sim.vision.visibility import is_visible

_TRIES = 1000


class Displacement(NamedTuple):
    """Horizontal displacement of a body during one step, in components.

    Attributes:
        ahead_m: Forward component.
        aside_m: Lateral component, positive towards the side on which the object is.
    """

    ahead_m: float
    aside_m: float


def displacement_to(body: Body, target: Floats, step_s: float) -> Displacement:
    """Return the two components of the paper's helper reward of ObjectNav and MultiAgentNav.

    The reward in the paper (appendix, "ObjectNav & MultiAgentNav") is
    ``Vis * (0.05 a_f + 0.03 a_l L)`` with the velocity's forward and left components and L = 1 or
    -1 for an object on the left or right. The paper gives no unit. Here the velocity is in metres
    per step: in metres per second, 25 times as much, going to and fro in front of an object has a
    higher return than reaching it.

    Args:
        body: The body.
        target: Position of the object, ``(3,)`` metres.
        step_s: Duration of an environment step.
    """
    forward, way = body.forward, body.velocity * step_s
    left = np.array([-forward[1], forward[0], 0.0])
    side = float(np.sign(left @ (target - body.position)))
    return Displacement(float(forward @ way), float(left @ way) * side)


def gap_m(place: Floats, prop: Prop) -> float:
    """Return the horizontal distance from a place to the surface of a prop, metres."""
    return horizontal_distance(place, prop.position) - prop.radius_m


def free_place(
    room: RoomCfg, props: Sequence[Prop], clear_m: float, rng: np.random.Generator
) -> Floats:
    """Draw a place on the floor of a room that is clear of walls and props.

    Args:
        room: The room.
        props: Props to keep away from.
        clear_m: Least distance from walls and surfaces of props.
        rng: Random generator of the episode.

    Returns:
        ``(3,)`` metres.

    Raises:
        ValueError: If none of 1000 draws is clear.
    """
    for _ in range(_TRIES):
        place = room.sample_floor(rng, clear_m)
        if _is_clear(place, props, clear_m):
            return place
    raise ValueError(f"room {room.name!r} leaves no floor {clear_m} m away from everything")


def free_pair(
    room: RoomCfg, props: Sequence[Prop], clear_m: float, apart_m: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw two places as `free_place` does, at a least distance from each other.

    Both are drawn together, since a first one in the middle of a small room may exclude every
    second one.

    Args:
        room: The room.
        props: Props to keep away from.
        clear_m: Least distance from walls and surfaces of props.
        apart_m: Least distance of the places from each other.
        rng: Random generator of the episode.

    Returns:
        Two places, ``(3,)`` metres each.

    Raises:
        ValueError: If none of 1000 pairs is clear.
    """
    for _ in range(_TRIES):
        one, other = room.sample_floor(rng, clear_m), room.sample_floor(rng, clear_m)
        if horizontal_distance(one, other) < apart_m:
            continue
        if _is_clear(one, props, clear_m) and _is_clear(other, props, clear_m):
            return one, other
    raise ValueError(
        f"room {room.name!r} leaves no two places {apart_m} m apart and {clear_m} m away from "
        "everything"
    )


def _is_clear(place: Floats, props: Sequence[Prop], clear_m: float) -> bool:
    return all(gap_m(place, prop) >= clear_m for prop in props)


class PropVisibility:
    """Visibility of one prop to players, cached for each version of the scene.

    Args:
        scene: The scene that eyes see.
        prop: The prop.
    """

    def __init__(self, scene: Scene, prop: Prop) -> None:
        self._scene, self._prop = scene, prop
        self._cache: dict[str, tuple[int, bool]] = {}

    def clear(self) -> None:
        """Clear the cache."""
        self._cache.clear()

    def for_player(self, player: Player) -> bool:
        """Return whether the prop is visible to the left eye of a player."""
        version, seen = self._cache.get(player.name, (-1, False))
        if version != self._scene.version:
            seen = is_visible(self._scene, player.body, self._prop)
            self._cache[player.name] = self._scene.version, seen
        return seen
