"""Places in houses: free floor, the searched object, distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.sim.geometry import Bools, Floats, horizontal_distance
from veca_marl.sim.physics import (
    PlannedProp,
    PlaygroundCfg,
    Prop,
    PropCfg,
    PropShape,
    RoomCfg,
    StandingProp,
    World,
)

_DRAWS = 1000
_PAIR_DRAWS = 10_000
_LEAST_SHARE = 0.001  # of the pairs that are drawn: none of them fits in 5 of 100 000 attempts
_SAMPLES = 200  # places for an estimate of that share


def furniture_of(world: World) -> list[Prop]:
    """Return the tangible props of a world that are no walls."""
    return [prop for prop in world.props.values() if is_furniture(prop.cfg)]


def planned_furniture(playground: PlaygroundCfg) -> list[PlannedProp]:
    """Return what `furniture_of` returns for a world of a playground, without building one."""
    return [PlannedProp(prop) for prop in playground.built_props() if is_furniture(prop)]


def is_furniture(prop: PropCfg) -> bool:
    """Return whether a prop is tangible and no wall."""
    return prop.tangible and prop.shape is not PropShape.wall


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


def gap_m(place: Floats, prop: StandingProp) -> float:
    """Return the horizontal distance from a place to the surface of a prop, metres."""
    return horizontal_distance(place, prop.position) - prop.radius_m


def free_place(
    room: RoomCfg, props: Sequence[StandingProp], clear_m: float, rng: np.random.Generator
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
    raise ValueError(
        f"room {room.name!r} of {room.extent} leaves no floor {clear_m:g} m away from everything"
    )


def free_pair(
    room: RoomCfg,
    props: Sequence[StandingProp],
    clear_m: float,
    apart_m: float,
    rng: np.random.Generator,
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
        ValueError: If none of 10 000 pairs is clear.
    """
    for _ in range(_PAIR_DRAWS):
        one, other = room.sample_floor(rng, clear_m), room.sample_floor(rng, clear_m)
        if horizontal_distance(one, other) < apart_m:
            continue
        if _is_clear(one, props, clear_m) and _is_clear(other, props, clear_m):
            return one, other
    raise ValueError(
        f"room {room.name!r} of {room.extent} leaves no two places {apart_m:g} m apart and "
        f"{clear_m:g} m away from everything"
    )


def rooms_with_pairs(playground: PlaygroundCfg, clear_m: float, apart_m: float) -> list[RoomCfg]:
    """Return the rooms in which `free_pair` finds places, by a trial with a fixed generator.

    Raises:
        ValueError: If there is none.
    """
    props, rng = planned_furniture(playground), np.random.default_rng(0)
    rooms = [
        room
        for room in playground.rooms
        if _pair_share(room, props, clear_m, apart_m, rng) >= _LEAST_SHARE
    ]
    if not rooms:
        raise ValueError(
            f"no room leaves two places {apart_m:g} m apart and {clear_m:g} m away from everything "
            f"({', '.join(f'{room.name} {room.extent}' for room in playground.rooms)})"
        )
    return rooms


def _pair_share(
    room: RoomCfg,
    props: Sequence[StandingProp],
    clear_m: float,
    apart_m: float,
    rng: np.random.Generator,
) -> float:
    """Estimate the share of all pairs of places of a room that `free_pair` accepts."""
    extent_m = np.array(room.size_m[:2]) - 2.0 * clear_m
    if extent_m.min() < 0.0:
        return 0.0
    drawn = np.array(room.lower_m[:2]) + clear_m + extent_m * rng.random((_SAMPLES, 2))
    clear = drawn[_are_clear(drawn, props, clear_m)]
    offsets = clear[:, None] - clear
    apart = np.hypot(offsets[..., 0], offsets[..., 1]) >= apart_m
    return float(apart.sum()) / _SAMPLES**2


def _are_clear(points: Floats, props: Sequence[StandingProp], clear_m: float) -> Bools:
    """Return which of many points ``(n, 2)`` are clear of props, as `_is_clear` of each."""
    clear: Bools = np.ones(len(points), bool)
    for prop in props:
        away_m = np.hypot(*(points - prop.position[:2]).T) - prop.radius_m
        near = np.flatnonzero(clear & (away_m < clear_m))
        clear[near] = clearances_m(prop, points[near]) >= clear_m
    return clear


def _is_clear(place: Floats, props: Sequence[StandingProp], clear_m: float) -> bool:
    return all(_keeps_away(place, prop, clear_m) for prop in props)


def _keeps_away(place: Floats, prop: StandingProp, clear_m: float) -> bool:
    """Return whether a prop is so far away: by the circle round it, or else by its shape."""
    return gap_m(place, prop) >= clear_m or float(clearances_m(prop, place[:2])) >= clear_m
