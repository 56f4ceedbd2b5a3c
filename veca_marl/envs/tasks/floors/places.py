"""Random positions on the floors of rooms, clear of furniture, and the start of players there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS
from veca_marl.sim.geometry import Bools, Floats, distances_to, horizontal_distance
from veca_marl.sim.physics import (
    DoorCfg,
    PlannedProp,
    PlaygroundCfg,
    Prop,
    PropCfg,
    PropShape,
    RoomCfg,
    StandingProp,
    World,
)

WALKER_HEIGHTS_M = np.array([0.05, 0.2, 0.35, 0.5, 0.65])  # of a body of 0.78 m; lintels are above
_ROUNDING_M = 1e-9  # by which the distance to a circle and to a shape may differ where they touch


class Clearances:
    """Distances from points of the floor to several props, at the poses that these have now.

    Most props are too far away to matter: only those are measured by their shape of which the
    circle about them on the floor plan is near. Props that can tilt have no such circle.

    Args:
        props: The props.
        heights_m: Heights above the floor at which distances are measured, see `clearances_m`.
    """

    def __init__(self, props: Sequence[StandingProp], heights_m: Floats = WALKER_HEIGHTS_M) -> None:
        self._props, self._heights_m = list(props), heights_m
        self._centres = np.array([prop.position[:2] for prop in props]).reshape(-1, 2)
        self._radii_m = np.array([prop.reach_m if prop.fixed else np.inf for prop in props])

    def all_at_least(self, points: Floats, clear_m: float) -> bool:
        """Return whether some points are at a least distance from all props.

        Args:
            points: ``(2,)`` or ``(n, 2)`` metres.
            clear_m: The distance, see `clearances_m`.
        """
        near = self._may_be_nearer(points.reshape(-1, 2), clear_m + _ROUNDING_M)
        return all(
            bool((clearances_m(self._props[number], points, self._heights_m) >= clear_m).all())
            for number in np.flatnonzero(near).tolist()
        )

    def _may_be_nearer(self, points: Floats, distance_m: float) -> Bools:
        """Return which of the circles about the props are nearer than a distance to a point."""
        offsets = points[:, None] - self._centres
        gaps_m = np.hypot(offsets[..., 0], offsets[..., 1]) - self._radii_m
        nearer: Bools = (gaps_m < distance_m).any(axis=0)
        return nearer


def clearances_m(
    prop: StandingProp, points: Floats, heights_m: Floats = WALKER_HEIGHTS_M
) -> Floats:
    """Return the least distance to a prop at some heights above points of the floor.

    Args:
        prop: The prop, at its present pose.
        points: ``(..., 2)`` metres.
        heights_m: The heights, ``(n,)`` metres; 0.05 to 0.65 m if they are not given.

    Returns:
        ``(...)`` metres, negative inside of the prop.
    """
    above = np.empty((*points.shape[:-1], len(heights_m), 3))
    above[..., :2] = points[..., None, :]
    above[..., 2] = heights_m
    own = (above - prop.position) @ prop.rotation
    distances = [distances_to(geom, own).min(axis=-1) for geom in prop.geoms]
    least: Floats = np.min(distances, axis=0)
    return least


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
    return world.add_prop(_target(radius_m))


def planned_target(radius_m: float) -> PlannedProp:
    """Return what `add_target` adds, standing at the origin of the floor plan."""
    thing = PlannedProp(_target(radius_m))
    thing.place((0.0, 0.0, radius_m))
    return thing


def _target(radius_m: float) -> PropCfg:
    return PropCfg(
        name="target",
        shape=PropShape.sphere,
        size_m=[radius_m],
        colour=(0.95, 0.15, 0.1),
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


_SCATTERED_DRAWS = 300  # of one place, until all places are drawn again
_RESTARTS = 20


class Spacing(NamedTuple):
    """Least distances of drawn places.

    Attributes:
        clear_m: From walls and from surfaces of furniture.
        apart_m: From each other.
        door_m: From the middles of doors.
    """

    clear_m: float
    apart_m: float
    door_m: float


def scattered_places(
    playground: PlaygroundCfg,
    furniture: Sequence[StandingProp],
    count: int,
    spacing: Spacing,
    rng: np.random.Generator,
) -> list[Floats]:
    """Draw places uniformly on the floors of all rooms, subject to a spacing.

    Args:
        playground: The rooms and doors.
        furniture: Props to keep away from.
        count: Number of places.
        spacing: Least distances.
        rng: Random generator of the episode.

    Returns:
        `count` places, ``(3,)`` metres each.

    Raises:
        ValueError: If none of 20 attempts succeeds; the message names the playground.
    """
    rooms = wide_rooms(playground.rooms, spacing.clear_m)
    clearances = Clearances(furniture)
    for _ in range(_RESTARTS if rooms else 0):
        found: list[Floats] = []
        for _ in range(_SCATTERED_DRAWS):
            place = _random_place(rooms, spacing.clear_m, rng)
            if _keeps(place, found, clearances, playground.doors, spacing):
                found.append(place)
            if len(found) == count:
                return found
    widest = max(playground.rooms, key=lambda room: min(room.size_m[:2]))
    raise ValueError(
        f"playground {playground.name!r} leaves no {count} places {spacing.apart_m:.2f} m apart "
        f"and {spacing.clear_m:.2f} m away from furniture and walls (its widest room is "
        f"{widest.extent})"
    )


def wide_rooms(rooms: Sequence[RoomCfg], clear_m: float) -> list[RoomCfg]:
    """Return the rooms with floor at a distance from their walls, in which places are drawn."""
    return [room for room in rooms if min(room.size_m[:2]) > 2.0 * clear_m]


def _random_place(rooms: Sequence[RoomCfg], clear_m: float, rng: np.random.Generator) -> Floats:
    """Draw a place uniformly on the floors of rooms, at a distance from their walls."""
    areas = [math.prod(size - 2.0 * clear_m for size in room.size_m[:2]) for room in rooms]
    room = rooms[int(rng.choice(len(rooms), p=np.array(areas) / sum(areas)))]
    return room.sample_floor(rng, clear_m)


def _keeps(
    place: Floats,
    others: Sequence[Floats],
    furniture: Clearances,
    doors: Sequence[DoorCfg],
    spacing: Spacing,
) -> bool:
    return (
        all(horizontal_distance(place, other) >= spacing.apart_m for other in others)
        and all(math.dist(place[:2], door.position_m) >= spacing.door_m for door in doors)
        and furniture.all_at_least(place[:2], spacing.clear_m)
    )


_HORIZON_M = 10.0


def place_player(player: Player, place: Floats, heading_rad: float) -> None:
    """Place a player: a walker standing, a joint-level body on hands and knees.

    Args:
        player: The player.
        place: ``(2,)`` or ``(3,)`` metres; the height is ignored.
        heading_rad: Heading.
    """
    position = np.array([place[0], place[1], 0.0])
    if isinstance(player.body, Humanoid):
        player.body.place(position, heading_rad, ON_ALL_FOURS)
    else:
        player.body.place(position, heading_rad)


def direct_gaze_ahead(players: Sequence[Player]) -> None:
    """Turn the eyes of joint-level bodies to the horizon in front, as far as they turn.

    On hands and knees the face points to the floor.
    """
    for player in players:
        body = player.body
        if isinstance(body, Humanoid):
            body.look_toward_point(body.mount("head").position + _HORIZON_M * body.forward)
