"""Where a capsule goes that something moves against fixed or jammed things.

A heavy thing can displace a walker by any distance, a wall behind it only by as much as it is in
the wall. If both counted alike, the walker would be moved into the wall, and out of it on its other
side. Here it first makes way for what moves, by less than its radius from where it was, so that its
axis stays on the same side of everything fixed, and is then moved out of fixed things only.

Light things can be jammed between the capsule and something else. A kinematic pusher has no limit
of its force. Bullet's solver cannot meet the contacts of a thing that is pressed against a wall or
the floor, and drives it into one of the two. Such a thing is an obstacle: the capsule overlaps it,
and it overlaps what is behind it, by a few millimetres together.

What is behind it can be another light thing. It counts if it is supported in turn, and so on up to
something that does not give way: a row of boxes is pushed along until its end meets a wall. Where
the row ends at the capsule of another walker, both walkers make room, see `JammedProps.squeezes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Scene
from veca_marl.sim.kernels import compiled
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.bullet_client import BulletClient, ContactPoint

Overlap = tuple[Sequence[float], float]
"""Direction ``(3,)`` towards the capsule, and metres."""

Place = tuple[float, float]
"""``(x, y)`` on the floor plan, metres."""

FIRM_M = 1e-3
"""A fixed thing may be overlapped by so much, which is more than rounding."""

_DEPTH_M = 1e-6  # less is rounding
_ROUNDS = 6  # acute corners take several
_MADE_WAY = 0.9  # of the radius, at most


class MovedCapsule(Protocol):
    """What `make_way` moves; at the end it is where the walker is."""

    @property
    def radius_m(self) -> float:
        """Radius about its axis."""
        ...

    def move_to(self, x: float, y: float) -> None:
        """Move it to a place."""
        ...

    def firm_overlaps(self) -> Iterator[Overlap]:
        """Yield how deep it is in what is fixed, or cannot give way."""
        ...

    def pushes(self) -> Iterator[Overlap]:
        """Yield by how much what moves displaces it."""
        ...


def may_reach(capsule: MovedCapsule, place: Place, last: Place) -> bool:
    """Return whether the axis is still on the same side of everything fixed, however thin.

    Args:
        capsule: The capsule.
        place: Where it would be.
        last: Where it was at the end of the last physics step.
    """
    return math.dist(place, last) <= capsule.radius_m


def make_way(capsule: MovedCapsule, asked: Place, found: Place, last: Place) -> Place:
    """Move a capsule to where nothing has moved it into fixed things; return the place.

    A walker that is squeezed may walk where it is squeezed less, and otherwise does not walk.

    Args:
        capsule: The capsule.
        asked: Its place before contacts were resolved.
        found: The place at which contacts with all that moves and is fixed alike have ended.
        last: Its place at the end of the last physics step.
    """
    last_m = _firm_m(capsule, last)
    if last_m > capsule.radius_m / 2.0:  # something fixed was placed here
        capsule.move_to(*found)
        return found
    pushed_m = max(deepest_m(capsule.pushes()), FIRM_M)
    firm_m = max(last_m, FIRM_M)
    place, is_possible = found, False
    for start in (None, asked, last):
        place = found if start is None else _made_way(capsule, start, last)
        is_possible = may_reach(capsule, place, last) and _firm_m(capsule, place) <= firm_m
        if is_possible and deepest_m(capsule.pushes()) <= pushed_m:
            return place
    if not is_possible:
        place = last
        capsule.move_to(*last)
    return place


def _made_way(capsule: MovedCapsule, start: Place, last: Place) -> Place:
    """Move a capsule out of what pushes it, then out of fixed things; return the place."""
    capsule.move_to(*start)
    out_x, out_y = depenetration(capsule.pushes())
    x, y = _towards(last, (start[0] + out_x, start[1] + out_y), _MADE_WAY * capsule.radius_m)
    for _ in range(_ROUNDS):
        capsule.move_to(x, y)
        out_x, out_y = depenetration(capsule.firm_overlaps())
        if out_x == 0.0 and out_y == 0.0:
            break
        x, y = x + out_x, y + out_y
    return x, y


def _firm_m(capsule: MovedCapsule, place: Place) -> float:
    """Move a capsule to a place; return how deep it is in something fixed there, metres."""
    capsule.move_to(*place)
    return deepest_m(capsule.firm_overlaps())


def _towards(start: Place, end: Place, most_m: float) -> Place:
    """Return the point on the way from one point to another, at most some metres from the start."""
    length_m = math.dist(start, end)
    share = min(1.0, most_m / length_m) if length_m else 0.0
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def depenetration(overlaps: Iterable[Overlap]) -> tuple[float, float]:
    """Return the horizontal displacement that ends all overlaps, metres."""
    out_x = out_y = 0.0
    for normal, depth in overlaps:
        length = math.hypot(normal[0], normal[1])
        if depth > _DEPTH_M and length > 0.1:
            # several points of one face give the same direction: the deepest counts
            away_x, away_y = normal[0] / length * depth, normal[1] / length * depth
            out_x = _larger(out_x, away_x)
            out_y = _larger(out_y, away_y)
    return out_x, out_y


def deepest_m(overlaps: Iterable[Overlap]) -> float:
    """Return the depth of the deepest overlap that a horizontal displacement can end, metres."""
    level = (depth for normal, depth in overlaps if math.hypot(normal[0], normal[1]) > 0.1)
    return max(level, default=0.0)


def _larger(a: float, b: float) -> float:
    """Return the number with the larger absolute value."""
    return a if abs(a) >= abs(b) else b


# a thing that can move overlaps the capsule by less than 1 mm and the floor by 2 mm
_PRESSED_M = 4e-3
# things that touch are at most so far apart, and the capsule is not moved back any further
_GAP_M = 1e-3
_BEHIND = 0.1  # least cosine of the angle between the push and what it is supported against
_SQUEEZED_M = 1e-4  # what two walkers press together may overlap by so much more


class _Backing(NamedTuple):
    """A point at which something else supports a thing.

    Attributes:
        body_id: PyBullet's id of the support.
        point: ``(3,)`` metres, on the thing.
        normal: ``(3,)`` from the support to the thing.
        depth_m: How far the two overlap; negative if they are apart.
    """

    body_id: int
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth_m: float


@compiled
def near_circles(
    positions: Floats,
    rows: NDArray[np.int64],
    radii_m: Floats,
    position: Floats,
    reach_m: float,
) -> NDArray[np.int64]:
    """Return the numbers of the circles within a distance of a point on the floor plan.

    Args:
        positions: ``(F, 3)`` metres, of all frames.
        rows: ``(n,)`` the frames of the circles' centres.
        radii_m: ``(n,)`` metres.
        position: ``(2,)`` or ``(3,)`` metres.
        reach_m: The distance.
    """
    found = np.empty(len(rows), np.int64)
    count = 0
    for n in range(len(rows)):
        x, y = positions[rows[n], 0] - position[0], positions[rows[n], 1] - position[1]
        if math.hypot(x, y) < radii_m[n] + reach_m:
            found[count] = n
            count += 1
    return found[:count]


class JammedProps:
    """The light props near a capsule, and which of them cannot move out of its way.

    Args:
        client: The PyBullet client.
        scene: The scene that shows the props.
        capsule_id: PyBullet's id of the capsule.
        props: Light props without a joint.
        leaves: Light props with a joint.

    Attributes:
        found: Whether the capsule had to move out of something since the last `forget`.
    """

    def __init__(
        self,
        client: BulletClient,
        scene: Scene,
        capsule_id: int,
        props: Sequence[Prop],
        leaves: Sequence[Prop],
    ) -> None:
        self._client, self._scene, self._capsule_id = client, scene, capsule_id
        self._props = list(props)
        self._light = {prop.body_id: prop for prop in (*props, *leaves)}
        self._rows = np.array([scene.objects[prop.object_id].rows.start for prop in props], int)
        self._extents_m = np.array([prop.extent_m for prop in props])
        self._near: list[Prop] = []
        self._touched: dict[int, Prop] = {}
        self._capsules: frozenset[int] = frozenset()
        self._backings: dict[int, list[_Backing]] = {}
        self.found = False

    def collect(
        self,
        position: Floats,
        reach_m: float,
        leaves: Sequence[Prop],
        capsules: Collection[int],
    ) -> None:
        """Collect what may come within a distance of the capsule within this agent step.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: Metres.
            leaves: Light props with a joint within that distance.
            capsules: PyBullet's ids of the capsules of all walkers.
        """
        self.forget()
        self._capsules = frozenset(capsules)
        circles = self._scene.positions, self._rows, self._extents_m
        numbers = near_circles(*circles, position, reach_m).tolist()
        self._near = [self._props[number] for number in numbers]
        self._near += leaves
        for prop in self._near:
            prop.rest.wake()  # a capsule has no mass, so it does not wake what it touches

    @property
    def are_near(self) -> bool:
        """Whether there is anything that the last `collect` has found."""
        return bool(self._near)

    def forget(self) -> None:
        """Forget what is behind the things, because they are about to move."""
        self._backings = {}
        self._touched = {}
        self.found = False

    def overlaps(self) -> Iterator[Overlap]:
        """Yield by how much the capsule has to move out of what is jammed, where it is now.

        Yields:
            The direction ``(3,)`` from the thing to the capsule, and metres.
        """
        for prop, point in self._pressed(self._near):
            self._touched[prop.body_id] = prop
            excess_m = self._overlap_m(prop, point, self._holds_firm) - _PRESSED_M
            if excess_m > 0.0:
                self.found = True
                yield point.normal_on_b, min(excess_m, _GAP_M - point.distance_m)

    def squeezes(self) -> Iterator[Overlap]:
        """Yield by how much the capsule makes room for what it and another walker press together.

        It is half of what both overlap too much, where they are now: the other makes as much room.
        It counts for things that the capsule has touched since the last `forget`.

        Yields:
            The direction ``(3,)`` from the thing to the capsule, and metres.
        """
        self._backings = {}  # other walkers have moved
        for prop, point in self._pressed(self._touched.values()):
            excess_m = self._overlap_m(prop, point, self._is_walker) - _PRESSED_M
            if excess_m > _SQUEEZED_M:
                yield point.normal_on_b, min(excess_m / 2.0, _GAP_M - point.distance_m)

    def _pressed(self, props: Iterable[Prop]) -> Iterator[tuple[Prop, ContactPoint]]:
        """Yield PyBullet's closest points of the capsule and things that are in its way."""
        for prop in props:
            if prop.holder is not None:
                continue  # its pose is set at each physics step
            for point in self._client.getClosestPoints(self._capsule_id, prop.body_id, _GAP_M):
                yield prop, point

    def _overlap_m(
        self, prop: Prop, point: ContactPoint, ends: Callable[[_Backing], bool]
    ) -> float:
        """Return how far a capsule and what is behind a thing overlap the thing together.

        Args:
            prop: The thing.
            point: PyBullet's closest point of the capsule and the thing.
            ends: Whether a support does not give way.

        Returns:
            Metres along the normal of the point; minus infinity where nothing is behind the thing.
        """
        behind_m = self._behind_m(prop.body_id, point.normal_on_b, ends, {prop.body_id})
        return behind_m - point.distance_m

    def _behind_m(
        self,
        body_id: int,
        normal: Sequence[float],
        ends: Callable[[_Backing], bool],
        visited: set[int],
    ) -> float:
        """Return how far a thing overlaps what is behind it, up to what does not give way.

        Args:
            body_id: PyBullet's id of the thing.
            normal: ``(3,)`` from the thing to what pushes it.
            ends: Whether a support does not give way.
            visited: The things before it in a row; those behind it are added.

        Returns:
            Metres along the normal; minus infinity if everything behind it gives way.
        """
        deepest_m = -np.inf
        for backing in self._backings_of(body_id):
            cosine = _dot(normal, backing.normal)
            if cosine <= _BEHIND:
                continue
            if ends(backing):
                deepest_m = max(deepest_m, backing.depth_m * cosine)
            elif backing.body_id in self._light and backing.body_id not in visited:
                visited.add(backing.body_id)
                row_m = self._behind_m(backing.body_id, backing.normal, ends, visited)
                deepest_m = max(deepest_m, (backing.depth_m + row_m) * cosine)
        return deepest_m

    def _holds_firm(self, backing: _Backing) -> bool:
        """Return whether a support is no walker and cannot be pushed away."""
        prop = self._light.get(backing.body_id)
        if prop is None:
            return not self._is_walker(backing)
        push = [-axis for axis in backing.normal]
        return prop.holder is not None or not prop.yields(backing.point, push)

    def _is_walker(self, backing: _Backing) -> bool:
        """Return whether a support is the capsule of another walker."""
        return backing.body_id in self._capsules

    def _backings_of(self, body_id: int) -> list[_Backing]:
        """Return where other bodies than the capsule touch a body."""
        if body_id not in self._backings:
            # the contacts of the last physics step say which bodies, but not how deep they are now
            contacts = self._client.getContactPoints(body_id)
            others = sorted({contact.body_b for contact in contacts} - {self._capsule_id})
            self._backings[body_id] = [
                _Backing(other, point.position_on_a, point.normal_on_b, -point.distance_m)
                for other in others
                for point in self._client.getClosestPoints(body_id, other, _GAP_M)
            ]
        return self._backings[body_id]


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the scalar product of two vectors of three numbers; quicker than with arrays."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
