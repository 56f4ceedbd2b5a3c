"""Light things that are jammed between the capsule of a walker and something else.

A kinematic pusher has no limit of its force. Bullet's solver cannot meet the contacts of a thing
that is pressed against a wall or the floor, and drives it into one of the two. Such a thing is an
obstacle: the capsule overlaps it, and it overlaps what is behind it, by a few millimetres together.

What is behind it can be another light thing. It counts if it is supported in turn, and so on up to
something that does not give way: a row of boxes is pushed along until its end meets a wall. Where
the row ends at the capsule of another walker, both walkers make room, see `JammedProps.squeezes`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.walker.making_way import Overlap
from veca_marl.sim.geometry import Floats, Scene
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.bullet_client import BulletClient, ContactPoint

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
        self._rows = [scene.objects[prop.object_id].rows.start for prop in props]
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
        away = self._scene.positions[self._rows, :2] - position[:2]
        near = np.hypot(away[:, 0], away[:, 1]) < self._extents_m + reach_m
        self._near = [self._props[number] for number in np.flatnonzero(near).tolist()]
        self._near += leaves
        for prop in self._near:
            prop.rest.wake()  # a capsule has no mass, so it does not wake what it touches

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
