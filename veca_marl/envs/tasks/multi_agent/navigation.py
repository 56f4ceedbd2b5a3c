"""What the tasks of seeking share: free places, sight of the object, the paper's helper reward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Scene, horizontal_distance
from veca_marl.sim.physics import Prop, RoomCfg
from veca_marl.sim.vision.visibility import is_visible

_TRIES = 1000


class Way(NamedTuple):
    """What a body covered in one step, as its own axes and an object's side split it.

    Attributes:
        ahead_m: Forward, backward when negative.
        aside_m: Toward the side the object is on, away from it when negative.
    """

    ahead_m: float
    aside_m: float


def way_to(body: Body, target: Floats, step_s: float) -> Way:
    """Return the two parts of the paper's helper reward of ObjectNav and MultiAgentNav.

    The paper (appendix, "ObjectNav & MultiAgentNav") pays ``Vis * (0.05 a_f + 0.03 a_l L)``, the
    velocity forward and left, L = 1 or -1 for an object on the left or right. It gives no unit.
    Here it is metres per step: in metres per second, 25 times as much, running up to an object,
    turning away and coming back is worth more than arriving.

    Args:
        body: Who goes.
        target: ``(3,)`` metres, where the object is.
        step_s: Time of one step.
    """
    forward, way = body.forward, body.velocity * step_s
    left = np.array([-forward[1], forward[0], 0.0])
    side = float(np.sign(left @ (target - body.position)))
    return Way(float(forward @ way), float(left @ way) * side)


def gap_m(place: Floats, prop: Prop) -> float:
    """Return the way over the floor from a place ``(2,)`` or ``(3,)`` to the surface of a thing."""
    return horizontal_distance(place, prop.position) - prop.radius_m


def free_place(
    room: RoomCfg, things: Sequence[Prop], clear_m: float, rng: np.random.Generator
) -> Floats:
    """Draw a place of a room's floor, ``(3,)`` metres, that is clear of walls and things.

    Args:
        room: Where.
        things: What it must not be near to.
        clear_m: How far it stays from all of them, metres.
        rng: Draws it.

    Raises:
        ValueError: If there is none, or too little to find it by drawing.
    """
    for _ in range(_TRIES):
        place = room.sample_floor(rng, clear_m)
        if _is_clear(place, things, clear_m):
            return place
    raise ValueError(f"room {room.name!r} leaves no floor {clear_m} m away from everything")


def free_pair(
    room: RoomCfg, things: Sequence[Prop], clear_m: float, apart_m: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw two places as `free_place` does, that are apart.

    Both are drawn at once: a first one in the middle of a small room may leave none for a second.

    Args:
        room: Where.
        things: What they must not be near to.
        clear_m: How far they stay from all of them, metres.
        apart_m: How far they are from each other.
        rng: Draws them.

    Raises:
        ValueError: If there are none, or too few to find them by drawing.
    """
    for _ in range(_TRIES):
        one, other = room.sample_floor(rng, clear_m), room.sample_floor(rng, clear_m)
        if horizontal_distance(one, other) < apart_m:
            continue
        if _is_clear(one, things, clear_m) and _is_clear(other, things, clear_m):
            return one, other
    raise ValueError(
        f"room {room.name!r} leaves no two places {apart_m} m apart and {clear_m} m away from "
        "everything"
    )


def _is_clear(place: Floats, things: Sequence[Prop], clear_m: float) -> bool:
    return all(gap_m(place, thing) >= clear_m for thing in things)


class Sight:
    """Who sees a thing. An eye is asked once a picture: reward and expert share the answer.

    Args:
        scene: What is drawn.
        thing: What is looked for.
    """

    def __init__(self, scene: Scene, thing: Prop) -> None:
        self._scene, self._thing = scene, thing
        self._answers: dict[str, tuple[int, bool]] = {}

    def clear(self) -> None:
        """Forget all answers."""
        self._answers.clear()

    def of(self, player: Player) -> bool:
        """Say whether the thing is visible to a player's left eye now."""
        version, seen = self._answers.get(player.name, (-1, False))
        if version != self._scene.version:
            seen = is_visible(self._scene, player.body, self._thing)
            self._answers[player.name] = self._scene.version, seen
        return seen
