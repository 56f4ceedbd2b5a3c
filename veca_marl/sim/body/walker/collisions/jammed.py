"""Light things that are jammed between the capsule of a walker and something else.

A kinematic pusher has no limit of its force. Bullet's solver cannot meet the contacts of a thing
that is pressed against a wall or the floor, and drives it into one of the two. Such a thing is an
obstacle: the capsule overlaps it, and it overlaps what is behind it, by a few millimetres together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from veca_marl.sim.geometry import Floats, Scene
from veca_marl.sim.physics import Prop, pybullet

# a thing that can move overlaps the capsule by less than 1 mm and the floor by 2 mm
_PRESSED_M = 4e-3
# things that touch are at most so far apart, and the capsule is not moved back any further
_GAP_M = 1e-3
_BEHIND = 0.1  # least cosine of the angle between the push and what it is supported against
_OTHER_BODY, _NORMAL, _DISTANCE = 2, 7, 8  # entries of PyBullet's points of contact


class _Backing(NamedTuple):
    """A point at which something else supports a thing.

    Attributes:
        normal: ``(3,)`` from the support to the thing.
        depth_m: How far the two overlap; negative if they are apart.
    """

    normal: tuple[float, float, float]
    depth_m: float


class JammedProps:
    """The light props near a capsule, and which of them cannot move out of its way.

    Args:
        client: The PyBullet client.
        scene: The scene that shows the props.
        capsule_id: PyBullet's id of the capsule.
        props: Light props without a joint.

    Attributes:
        found: Whether the capsule had to move out of something since the last `forget`.
    """

    def __init__(self, client: int, scene: Scene, capsule_id: int, props: Sequence[Prop]) -> None:
        self._client, self._scene, self._capsule_id = client, scene, capsule_id
        self._props = list(props)
        self._rows = [scene.objects[prop.object_id].rows.start for prop in props]
        self._extents_m = np.array([prop.extent_m for prop in props])
        self._near: list[Prop] = []
        self._backings: dict[int, list[_Backing]] = {}
        self.found = False

    def collect(self, position: Floats, reach_m: float, leaves: Sequence[Prop]) -> None:
        """Collect what may come within a distance of the capsule within this agent step.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: Metres.
            leaves: Light props with a joint within that distance.
        """
        self.forget()
        away = self._scene.positions[self._rows, :2] - position[:2]
        near = np.hypot(away[:, 0], away[:, 1]) < self._extents_m + reach_m
        self._near = [self._props[number] for number in np.flatnonzero(near).tolist()]
        self._near += leaves

    def forget(self) -> None:
        """Forget what is behind the things, because they are about to move."""
        self._backings = {}
        self.found = False

    def overlaps(self) -> Iterator[tuple[Sequence[float], float]]:
        """Yield by how much the capsule has to move out of what is jammed, where it is now.

        Yields:
            The direction ``(3,)`` from the thing to the capsule, and metres.
        """
        for prop in self._near:
            if prop.holder is not None:
                continue  # its pose is set at each physics step
            for point in self._points(prop.body_id):
                excess_m = _overlap_m(point, self._backings_of(prop.body_id)) - _PRESSED_M
                if excess_m > 0.0:
                    self.found = True
                    yield point[_NORMAL], min(excess_m, _GAP_M - point[_DISTANCE])

    def _points(self, body_id: int) -> tuple[tuple[Any, ...], ...]:
        """Return PyBullet's closest points of the capsule and a body that is in its way."""
        found: tuple[tuple[Any, ...], ...] = pybullet.getClosestPoints(
            self._capsule_id, body_id, _GAP_M, physicsClientId=self._client
        )
        return found

    def _backings_of(self, body_id: int) -> list[_Backing]:
        """Return where other bodies than the capsule touch a body."""
        if body_id not in self._backings:
            # the contacts of the last physics step say which bodies, but not how deep they are now
            contacts = pybullet.getContactPoints(body_id, physicsClientId=self._client)
            others = sorted({contact[_OTHER_BODY] for contact in contacts} - {self._capsule_id})
            self._backings[body_id] = [
                _Backing(point[_NORMAL], -point[_DISTANCE])
                for other in others
                for point in pybullet.getClosestPoints(
                    body_id, other, _GAP_M, physicsClientId=self._client
                )
            ]
        return self._backings[body_id]


def _overlap_m(point: tuple[Any, ...], backings: Sequence[_Backing]) -> float:
    """Return how far a capsule and what is behind a thing overlap the thing together.

    Args:
        point: PyBullet's closest point of the capsule and the thing.
        backings: Where other things support it.

    Returns:
        Metres along the normal of the point; minus infinity where nothing is behind the thing.
    """
    behind = [
        backing.depth_m * cosine
        for backing in backings
        if (cosine := _dot(point[_NORMAL], backing.normal)) > _BEHIND
    ]
    return max(behind) - float(point[_DISTANCE]) if behind else -np.inf


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the scalar product of two vectors of three numbers; quicker than with arrays."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
