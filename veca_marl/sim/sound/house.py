"""Rooms and the obstacles between them, as the surroundings that sound propagates in.

Image sources are right inside one box. A listener in the room of a source hears it with the
reflections of that room, one in another room with those of both rooms, see `attenuated_paths`.
Obstacles (walls, leaves of doors, furniture) leave a fraction of the energy of each path in each
octave band, see `diffraction`, at their present poses. Reflections at obstacles are not modelled.

Within `NEAR_M` of a doorway the energies of the paths in one room change linearly to those of the
paths between its two rooms at the threshold, so that nothing steps where a head or a source passes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.attenuated_paths import Reflector, energies_between, energies_inside
from veca_marl.sim.sound.obstacles import Obstacles
from veca_marl.sim.sound.partitions import (
    MOST_LOSS_DB,
    N_BANDS,
    TRANSMISSION_LOSS_DB,
    surface_ratio,
)
from veca_marl.sim.sound.room_acoustics import Room, image_lattice, image_sources
from veca_marl.sim.sound.screens import Doorway, ScreenSets, nearest_box
from veca_marl.sim.sound.silhouettes import Screens
from veca_marl.sim.sound.surroundings import Arrivals, OneRoom

NEAR_M = 0.5
"""Distance from a doorway within which what is heard in one room changes to what is heard in both.
"""

_BETWEEN_ROOMS = -1  # `paths_id` of paths between rooms is this and below; rooms have 0 and up
_FRAME_M = 0.02  # distance from the sides and the top of a doorway of points on its threshold


class House:
    """Rooms and the obstacles between them. Serves a `SoundField` as its surroundings.

    Attributes:
        size: ``(3,)`` metres, the box round all rooms.
        longest_path_m: See `Surroundings`.
        obstacles: The walls and doors between the rooms; their owners add and move them.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        image_order: int = 1,
        transmission_loss_db: float = TRANSMISSION_LOSS_DB,
        doorways: Sequence[Doorway] = (),
    ) -> None:
        """Join rooms; there are no obstacles between them yet.

        Args:
            rooms: One or more; a point outside all of them belongs to the nearest.
            image_order: Greatest number of reflections inside a room.
            transmission_loss_db: Loss at 500 Hz of what passes through an obstacle.
            doorways: Openings in the walls between rooms, where these do not reflect.

        Raises:
            ValueError: If there is no room, or the loss is not from 0 to `MOST_LOSS_DB`.
        """
        if not rooms:
            raise ValueError("a house needs at least one room")
        if not 0.0 <= transmission_loss_db <= MOST_LOSS_DB:
            raise ValueError(
                f"transmission_loss_db={transmission_loss_db} must be from 0 to {MOST_LOSS_DB:g}"
            )
        self.obstacles = Obstacles()
        self._rooms = [OneRoom(room, image_order) for room in rooms]
        self._lattice, self._doorways = image_lattice(image_order), list(doorways)
        self._corners = (
            np.array([room.lower for room in rooms]),
            np.array([room.lower + room.size for room in rooms]),
        )
        self._lowest, self._highest = self._corners[0].min(axis=0), self._corners[1].max(axis=0)
        self.size: Floats = self._highest - self._lowest
        longest_m = [room.longest_path_m for room in self._rooms]
        self.longest_path_m = max(float(np.linalg.norm(self.size)), *longest_m)
        if len(rooms) > 1:  # a source outside of the room that reflects it
            self.longest_path_m += float(np.linalg.norm(self.size))
        self._surface_ratio = surface_ratio(transmission_loss_db)
        self._screens_of: tuple[int, ScreenSets] | None = None

    @property
    def changes(self) -> int:
        """See `Surroundings`: the obstacles that were added or moved."""
        return self.obstacles.changes

    def room_of(self, position: Floats) -> int:
        """Return the number of the room that contains a point ``(3,)``, or else of the nearest."""
        return int(nearest_box(position, *self._corners))

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """See `Surroundings`."""
        route = self._route(source, head.position)
        room, other = route.room, route.other
        if room == other:
            return self._arrivals_inside(room, source, head)
        ends = self._clamp(source), self._clamp(head.position)
        energies = self._energies(route, source, head.position, self._lattice)
        one, two = self._rooms[room], self._rooms[other]
        images = np.concatenate(
            [
                image_sources(ends[0], one.room.lower, one.room.size, self._lattice),
                image_sources(ends[0], two.room.lower, two.room.size, self._lattice[1:]),
            ]
        )
        paths_id = _BETWEEN_ROOMS - room * len(self._rooms) - other
        gains = np.concatenate([one.gains, two.gains[1:]])
        return Arrivals((images - ends[1]) @ head.rotation, gains, paths_id, energies)

    def _arrivals_inside(self, room: int, source: Floats, head: Pose) -> Arrivals:
        inside = self._rooms[room].arrivals(source, head)
        sets = self._screens
        if not (len(sets.inside[room]) or len(sets.openings[room].kinds)):
            return Arrivals(inside.vectors, inside.gains, room)
        energies = self._energies_inside(room, source, head.position, self._lattice)
        kept = None if (energies == 1.0).all() else energies
        return Arrivals(inside.vectors, inside.gains, room, kept)

    def direct_energy(self, source: Floats, head: Floats) -> Floats:
        """Return which fraction of the energy obstacles leave of the direct sound.

        Args:
            source: ``(3,)`` metres.
            head: ``(3,)`` metres.

        Returns:
            ``(N_BANDS,)`` from 0 to 1, see `partitions.BANDS_HZ`.
        """
        route = self._route(source, head)
        direct: Floats = self._energies(route, source, head, image_lattice(0))[0]
        return direct

    # ---- energies of paths

    def _energies(
        self, route: _Route, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats:
        """Return the energies of the direct sound and of images in one room, or in two.

        Args:
            route: See `_route`.
            source: ``(3,)`` metres.
            head: ``(3,)`` metres.
            lattice: ``(K, 3)`` from `image_lattice`.

        Returns:
            ``(2 K - 1, N_BANDS)``, or ``(K, N_BANDS)`` in one room.
        """
        if route.way is not None:
            return self._energies_near(route.room, route.way, source, head, lattice)
        if route.room == route.other:
            return self._energies_inside(route.room, source, head, lattice)
        return self._energies_between(route.room, route.other, source, head, lattice)

    def _energies_near(
        self, room: int, way: _Way, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats:
        """Return the energies of paths in a room, of which a doorway is near to one end or both."""
        n = len(lattice)
        energies = np.zeros((2 * n - 1, N_BANDS))
        shares = _shares(way.of_source, way.of_head)
        if shares[0] > 0.0:
            energies[:n] += shares[0] * self._energies_inside(room, source, head, lattice)
        if shares[1] > 0.0:
            end = self._on_threshold(room, way, head)
            energies += shares[1] * self._energies_between(room, way.other, source, end, lattice)
        if shares[2] > 0.0:  # its images are first those in the other room
            end = self._on_threshold(room, way, source)
            found = self._energies_between(way.other, room, end, head, lattice)
            energies += shares[2] * np.concatenate([found[:1], found[n:], found[1:n]])
        return energies

    def _energies_inside(
        self, room: int, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats:
        """Return the energies ``(K, N_BANDS)`` of paths in a room."""
        sets, one = self._screens, self._rooms[room]
        energies: Floats = energies_inside(
            one.bounded(source),
            one.bounded(head),
            self._reflector(room),
            lattice,
            sets.screens,
            self._surface_ratio,
        )
        return energies

    def _energies_between(
        self, room: int, other: int, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats:
        """Return the energies of paths between rooms, see `energies_between`."""
        sets = self._screens
        energies: Floats = energies_between(
            self._clamp(source),
            self._clamp(head),
            self._reflector(room),
            self._reflector(other),
            lattice,
            sets.between,
            sets.screens,
            self._surface_ratio,
        )
        return energies

    def _reflector(self, room: int) -> Reflector:
        """Return a room with what stands in it and the doorways in its walls."""
        sets, walls = self._screens, self._rooms[room].room
        return Reflector(walls.lower, walls.size, sets.inside[room], sets.openings[room])

    # ---- doorways

    def _route(self, source: Floats, head: Floats) -> _Route:
        """Return which rooms reflect the sound from a source ``(3,)`` to a head ``(3,)``."""
        room, other = self.room_of(source), self.room_of(head)
        way = self._nearest_doorway(room, source, head) if room == other else None
        return _Route(room, other if way is None else way.other, way)

    def _nearest_doorway(self, room: int, source: Floats, head: Floats) -> _Way | None:
        """Return the doorway that counts for a path in a room; None if none is near."""
        openings = self._screens.openings[room]
        if not len(openings.kinds):
            return None
        number, of_source, of_head = nearest_opening(source, head, openings)
        if number < 0:
            return None
        return _Way(number, int(openings.rooms[number]), of_source, of_head)

    def _on_threshold(self, room: int, way: _Way, position: Floats) -> Floats:
        """Return the point ``(3,)`` of a threshold that is beside a point in front of it."""
        openings = self._screens.openings[room]
        centre, half = openings.centres[way.opening], openings.halves[way.opening]
        axis, is_upper = divmod(int(openings.kinds[way.opening]), 2)
        reach = np.maximum(half - _FRAME_M, 0.0)
        point: Floats = np.minimum(np.maximum(position, centre - reach), centre + reach)
        lower, upper = self._corners
        own, others = (upper, lower) if is_upper else (lower, upper)
        point[axis] = (own[room, axis] + others[way.other, axis]) / 2.0  # where `room_of` changes
        return point

    @property
    def _screens(self) -> ScreenSets:
        """The screens at the present poses of the obstacles."""
        if self._screens_of is None or self._screens_of[0] != self.obstacles.changes:
            found = self.obstacles.screens(*self._corners, self._doorways)
            self._screens_of = self.obstacles.changes, found
        return self._screens_of[1]

    def _clamp(self, position: Floats) -> Floats:
        """Return the nearest point in the box round all rooms."""
        nearest: Floats = np.minimum(np.maximum(position, self._lowest), self._highest)
        return nearest


class _Way(NamedTuple):
    """A doorway near one end of a path in a room, or near both.

    Attributes:
        opening: Its number among the openings of the room.
        other: The room behind it.
        of_source: How near the source is, from 0 to 1 on the threshold.
        of_head: Likewise.
    """

    opening: int
    other: int
    of_source: float
    of_head: float


class _Route(NamedTuple):
    """The rooms that reflect the sound from a source to a head.

    Attributes:
        room: The source's room.
        other: The head's room, or the room behind a doorway that is near to a path in one room.
        way: That doorway; None if there is none, or the path leads to another room.
    """

    room: int
    other: int
    way: _Way | None


def _shares(of_source: float, of_head: float) -> tuple[float, float, float]:
    """Return the weights of three kinds of energies of paths in one room; their sum is 1.

    They are continuous but where both ends are on the threshold, and those of two ends exchanged.

    Args:
        of_source: How near a doorway is to the source, from 0 to 1 on its threshold.
        of_head: Likewise.

    Returns:
        The weights of the energies in the room, of those with the head on the threshold, and of
        those with the source on it.
    """
    inside = (1.0 - of_source) * (1.0 - of_head)
    head, source = of_head * (1.0 - of_source), of_source * (1.0 - of_head)
    if head + source == 0.0:
        return inside, (1.0 - inside) / 2.0, (1.0 - inside) / 2.0
    scale = (1.0 - inside) / (head + source)
    return inside, scale * head, scale * source


@kernel
def nearest_opening(source: Floats, head: Floats, openings: Screens) -> tuple[int, float, float]:
    """Return the opening that one of two points is nearest to within `NEAR_M`, -1 if none is.

    Args:
        source: ``(3,)`` metres.
        head: ``(3,)`` metres.
        openings: See `obstacles.ScreenSets`.

    Returns:
        Its number, and how near it is to source and head: 1 on the threshold, 0 at `NEAR_M`.
    """
    nearest, of_source, of_head, most = -1, 0.0, 0.0, 0.0
    for n in range(len(openings.centres)):
        one, two = _nearness(source, openings, n), _nearness(head, openings, n)
        either = one + two - one * two
        if either > most:
            nearest, of_source, of_head, most = n, one, two, either
    return nearest, of_source, of_head


@kernel
def _nearness(point: Floats, openings: Screens, number: int) -> float:
    """Return 1 for a point in an opening, less in proportion to its distance, 0 from `NEAR_M` on.

    What is in the thickness of the wall is in the opening.
    """
    square = 0.0
    for axis in range(3):
        away = point[axis] - openings.centres[number, axis]
        if axis == openings.kinds[number] // 2:
            away = -away if openings.kinds[number] % 2 == 1 else away
        else:
            away = abs(away)
        square += max(away - openings.halves[number, axis], 0.0) ** 2
    return max(1.0 - math.sqrt(square) / NEAR_M, 0.0)
