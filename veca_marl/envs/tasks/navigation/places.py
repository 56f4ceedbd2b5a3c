"""Places in houses: free floor, the searched object, distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, RoomCfg, World

_DRAWS = 1000


def check_rooms(playground: PlaygroundCfg, agents: int) -> None:
    """Check that a playground has a room for each agent.

    Raises:
        ValueError: If it has too few.
    """
    rooms = len(playground.rooms)
    if agents > rooms:
        raise ValueError(
            f"task.agents={agents} start in rooms of their own, but playground "
            f"{playground.name!r} has {rooms}; choose task.agents of at most {rooms}, or "
            "playground=two_rooms, three_rooms, four_rooms, seven_rooms, house, "
            "house2 or random_house"
        )


def furniture_of(world: World) -> list[Prop]:
    """Return the tangible props of a world that are no walls."""
    props = world.props.values()
    return [prop for prop in props if prop.cfg.tangible and prop.cfg.shape is not PropShape.wall]


def add_target(world: World, radius_m: float) -> Prop:
    """Add the object that is searched for, a fixed red ball."""
    return world.add_prop(
        PropCfg(
            name="target",
            shape=PropShape.sphere,
            size_m=[radius_m],
            colour=(0.95, 0.15, 0.1),
        )
    )


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
    for _ in range(_DRAWS):
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
    for _ in range(_DRAWS):
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
    return all(_keeps_away(place, prop, clear_m) for prop in props)


def _keeps_away(place: Floats, prop: Prop, clear_m: float) -> bool:
    """Return whether a prop is so far away: by the circle round it, or else by its shape."""
    return gap_m(place, prop) >= clear_m or float(clearances_m(prop, place[:2])) >= clear_m
