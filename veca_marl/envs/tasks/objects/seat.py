"""A check that a body at the origin and the things in front of it are in one room."""

from __future__ import annotations

import itertools
import math

from veca_marl.sim.physics import PlaygroundCfg

_AHEAD_M = 0.6  # outstretched legs, or the head of a body that lies on its back
_ASIDE_M = 0.45  # elbows


def check_seat(
    task: str,
    playground: PlaygroundCfg,
    ahead_m: float = 0.0,
    aside_m: float = 0.0,
    edge_m: float = 0.0,
    asked: str = "",
) -> None:
    """Check that a room has space for a body at the origin that faces +x, and for cubes.

    Args:
        task: Name of the task.
        playground: The playground.
        ahead_m: Greatest distance of the centre of a cube in front of the pelvis.
        aside_m: Greatest lateral distance of it.
        edge_m: Length of its edges; it may be turned.
        asked: The values of the task that place cubes, for the message.

    Raises:
        ValueError: If no room contains all of them.
    """
    corner_m = edge_m * math.sqrt(0.5)
    far, wide = max(ahead_m + corner_m, _AHEAD_M), max(aside_m + corner_m, _ASIDE_M)
    needed = list(itertools.product((-_AHEAD_M, far), (-wide, wide)))
    homes = [room for room in playground.rooms if room.distance_m((0.0, 0.0)) == 0.0]
    if any(all(room.distance_m(point) == 0.0 for point in needed) for room in homes):
        return
    rooms = " and ".join(f"room {room.name!r} of {room.extent}" for room in homes) or "no room"
    raise ValueError(
        f"{task} needs {far:.3g} m in front of the origin and {wide:.3g} m to its sides"
        f"{f' ({asked})' if asked else ''}; at the origin, playground {playground.name!r} has "
        f"{rooms}; choose {'smaller values or ' if asked else ''}playground=simple"
    )
