"""The boxes of a prop among the obstacles of the sound, which follow its pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry import Floats, Geom
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.props.joint_cfg import JointCfg
from veca_marl.sim.sound.obstacles import Obstacles


class SoundObstacle(Protocol):
    """A box that follows the pose of its prop."""

    def move(self, position: Floats, rotation: Floats) -> None:
        """Follow the frame of the prop: its origin ``(3,)`` metres and axes ``(3, 3)``."""
        ...


def make_obstacles(
    boxes: Sequence[Geom], joint: JointCfg | None, body_id: int, client: int, obstacles: Obstacles
) -> list[SoundObstacle]:
    """Add the boxes of a prop to the obstacles of the sound.

    Args:
        boxes: In the frame of the prop.
        joint: Its joint; with one it is a leaf.
        body_id: PyBullet's id of the prop.
        client: PyBullet's client id.
        obstacles: Those of its world.
    """
    if joint is None:
        return [_FreeBox(box, obstacles) for box in boxes]
    return [_Leaf(box, joint, body_id, client, obstacles) for box in boxes]


class _FreeBox:
    """A box of a prop without a joint."""

    def __init__(self, box: Geom, obstacles: Obstacles) -> None:
        self._offset, self._turn = np.asarray(box.offset), np.asarray(box.rotation)
        self._obstacles = obstacles
        self._number = obstacles.add(box.size)

    def move(self, position: Floats, rotation: Floats) -> None:
        """See `SoundObstacle`."""
        self._obstacles.move(
            self._number, position + rotation @ self._offset, rotation @ self._turn
        )


class _Leaf:
    """A box of a prop with a joint, and the opening that it closes."""

    def __init__(
        self, box: Geom, joint: JointCfg, body_id: int, client: int, obstacles: Obstacles
    ) -> None:
        self._offset, self._turn = np.asarray(box.offset), np.asarray(box.rotation)
        self._anchor = np.asarray(joint.anchor_m, np.float64)
        self._body_id, self._client = body_id, client
        self._obstacles = obstacles
        self._number = obstacles.add_leaf(box.size)
        self._base: tuple[object, ...] = ()

    def move(self, position: Floats, rotation: Floats) -> None:
        """See `SoundObstacle`."""
        self._obstacles.move_leaf(
            self._number, position + rotation @ self._offset, rotation @ self._turn
        )
        base = pybullet.getBasePositionAndOrientation(self._body_id, physicsClientId=self._client)
        if base != self._base:
            self._base = base
            self._move_opening(*base)

    def _move_opening(self, anchor: Sequence[float], quaternion: Sequence[float]) -> None:
        """Follow the base of the body: it is at the anchor, with the axes of the closed prop."""
        axes = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        centre = np.array(anchor) + axes @ (self._offset - self._anchor)
        self._obstacles.move_opening(self._number, centre, axes @ self._turn)
