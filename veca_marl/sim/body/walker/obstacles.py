"""Things that are in the way of a walker, and what stops those that it is in the way of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Scene, follow_poses, horizontal_distance
from veca_marl.sim.kernels import compiled
from veca_marl.sim.physics import Prop
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.physics.props.geoms import swept_radius_m
from veca_marl.sim.physics.props.joint import Joint


class ObstacleBoxes:
    """Bounding boxes ``(x, y)`` of things that walkers cannot push.

    Boxes of fixed props are read again only when one of them has been placed elsewhere; in a house
    they are nearly all of the props.

    Args:
        client: The PyBullet client.
        scene: The scene that shows the props.
        props: Fixed and heavy props.
        bodies: PyBullet's ids of heavy joint-level bodies.
        beyond_m: How far these reach beyond the bounding box of their base.

    Attributes:
        ids: PyBullet's ids of all obstacles, props first.
    """

    def __init__(
        self,
        client: BulletClient,
        scene: Scene,
        props: Sequence[Prop],
        bodies: Sequence[int],
        beyond_m: float,
    ) -> None:
        self._client, self._scene = client, scene
        self.ids = [prop.body_id for prop in props] + list(bodies)
        # the links that carry the shapes of each
        self._links = [prop.links for prop in props] + [range(-1, 0)] * len(bodies)
        self._beyond_m = np.array([0.0] * len(props) + [beyond_m] * len(bodies))
        self._low, self._high = np.zeros((2, len(self.ids), 2))
        fixed = [number for number, prop in enumerate(props) if prop.fixed]
        self._fixed, self._moving = fixed, sorted(set(range(len(self.ids))) - set(fixed))
        self._fixed_numbers, self._numbers = frozenset(fixed), list[int]()
        rows = [scene.objects[props[number].object_id].rows for number in fixed]
        self._frames = np.array([row.start for row in rows], int)
        self._places, self._turns = np.full((len(fixed), 3), np.inf), np.zeros((len(fixed), 3, 3))

    def near(self, position: Floats, reach_m: float) -> list[int]:
        """Return PyBullet's ids of the obstacles within a distance along x and y.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: Metres.
        """
        self._read(self._moving)
        scene = self._scene
        poses = scene.positions, scene.rotations, self._frames
        if follow_poses(*poses, self._places, self._turns).any():
            self._read(self._fixed)
        numbers = near_boxes(self._low, self._high, self._beyond_m, position, reach_m)
        self._numbers = numbers.tolist()
        return [self.ids[number] for number in self._numbers]

    def are_farther(self, position: Floats, reach_m: float) -> bool:
        """Return whether what `near` has found last is fixed, and farther than a distance.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: Metres along x or y.
        """
        if not self._fixed_numbers.issuperset(self._numbers):
            return False
        low, high = self._low[self._numbers], self._high[self._numbers]
        beyond_m = self._beyond_m[self._numbers]
        return len(near_boxes(low, high, beyond_m, position, reach_m)) == 0

    def _read(self, numbers: Sequence[int]) -> None:
        """Read the boxes of some obstacles from Bullet."""
        for number in numbers:
            links = iter(self._links[number])
            low, high = self._box(number, next(links))
            self._low[number], self._high[number] = low[:2], high[:2]
            for link in links:
                low, high = self._box(number, link)
                self._low[number] = np.minimum(self._low[number], low[:2])
                self._high[number] = np.maximum(self._high[number], high[:2])

    def _box(self, number: int, link: int) -> tuple[Sequence[float], Sequence[float]]:
        """Return the corners of Bullet's box about one link of an obstacle."""
        low, high = self._client.getAABB(self.ids[number], link)
        return low, high


@compiled
def near_boxes(
    low: Floats, high: Floats, beyond_m: Floats, position: Floats, reach_m: float
) -> NDArray[np.int64]:
    """Return the numbers of the boxes within a distance of a point along x and y.

    Args:
        low: ``(n, 2)`` metres, least corners.
        high: ``(n, 2)`` metres, greatest corners.
        beyond_m: ``(n,)`` additional distance of each.
        position: ``(2,)`` or ``(3,)`` metres.
        reach_m: The distance.
    """
    x, y = position[0], position[1]
    found = np.empty(len(low), np.int64)
    count = 0
    for n in range(len(low)):
        reach = reach_m + beyond_m[n]
        near_x = low[n, 0] - reach < x < high[n, 0] + reach
        near_y = low[n, 1] - reach < y < high[n, 1] + reach
        if near_x and near_y:
            found[count] = n
            count += 1
    return found[:count]


class Leaves:
    """Props with a joint, and which of them a walker can reach within an agent step.

    A leaf moves within a circle about the anchor of its joint, at any opening and speed.

    Args:
        props: Props with a joint.
    """

    def __init__(self, props: Sequence[Prop]) -> None:
        self._leaves: list[tuple[Prop, Joint, float]] = [
            (prop, prop.joint, swept_radius_m(prop.geoms, prop.joint.cfg))
            for prop in props
            if prop.joint is not None
        ]

    def near(self, position: Floats, reach_m: float) -> list[Prop]:
        """Return the leaves that may come within a distance of a point.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: The horizontal distance.
        """
        return [
            prop
            for prop, joint, swept_m in self._leaves
            if horizontal_distance(joint.anchor, position) < swept_m + reach_m
        ]


PARKED_M = -100.0
"""Height of a capsule that is not in use."""


class Stop:
    """Stops heavy things where a walker cannot make way for them.

    A walker does not collide with heavy things in Bullet: they displace it. Where something fixed
    is behind it, it cannot move, and Bullet has to stop them. Contacts of its own capsule cannot be
    enabled for a while: Bullet would number what they belong to anew, and by the numbers it orders
    the contacts that it solves, in later episodes as well. Hence this capsule, which collides with
    nothing but heavy things. It is far below the floor as long as it is not needed.

    Args:
        client: The PyBullet client.
        shape: PyBullet's id of the shape of the walker's capsule.
    """

    def __init__(self, client: BulletClient, shape: int) -> None:
        self._client = client
        self._body_id: int = client.createMultiBody(0, shape, basePosition=(0.0, 0.0, PARKED_M))
        self._parked = True
        client.changeDynamics(self._body_id, -1, lateralFriction=0.2, restitution=0.0)
        client.setCollisionFilterGroupMask(self._body_id, -1, 0, 0)

    def let_stop(self, body_id: int, link: int) -> None:
        """Let it stop one link of a body; -1 is the base."""
        self._client.setCollisionFilterPair(self._body_id, body_id, -1, link, 1)

    def put(self, position: Sequence[float], orientation: Sequence[float]) -> None:
        """Stop what comes to a place in the next physics step.

        Args:
            position: ``(3,)`` metres.
            orientation: ``(4,)`` quaternion (x, y, z, w).
        """
        self._parked = False
        self._client.resetBasePositionAndOrientation(self._body_id, position, orientation)

    def park(self) -> None:
        """Stop nothing from now on."""
        if not self._parked:
            self._parked = True
            upright = (0.0, 0.0, 0.0, 1.0)
            self._client.resetBasePositionAndOrientation(
                self._body_id, (0.0, 0.0, PARKED_M), upright
            )
