"""TinyRenderer, PyBullet's software renderer, applied to the primitives of a `Scene`."""

from __future__ import annotations

from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import GeomTable, Pose, Scene, Shape, matrix_to_quaternion
from veca_marl.sim.physics import pybullet, shape_arguments
from veca_marl.sim.vision import Camera


class TinyRenderer:
    """Renders the primitives of a scene, each as a body of a PyBullet client of its own.

    Use it as a context manager, which disconnects the client.

    Args:
        scene: The scene; its poses are those of the last `Scene.update`.
    """

    def __init__(self, scene: Scene) -> None:
        self._client: int = pybullet.connect(pybullet.DIRECT)
        for g in range(len(scene.geoms.shapes)):
            self._add(scene.geoms, g)

    def __enter__(self) -> TinyRenderer:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Disconnect from PyBullet."""
        pybullet.disconnect(self._client)

    def segment(self, camera: Camera, pose: Pose) -> NDArray[np.int32]:
        """Return the row of the visible primitive per pixel, ``(H, W)``, -1 for none."""
        forward, _, up = pose.rotation.T
        view = pybullet.computeViewMatrix(pose.position, pose.position + forward, up)
        projection = pybullet.computeProjectionMatrix(*_frustum(camera))
        *_, segmentation = pybullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            projection,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.reshape(segmentation, (camera.height, camera.width)).astype(np.int32)

    def _add(self, geoms: GeomTable, g: int) -> None:
        kind = shape_arguments(Shape(geoms.shapes[g]), geoms.sizes[g])
        visual = pybullet.createVisualShape(**kind, physicsClientId=self._client)
        orientation = matrix_to_quaternion(geoms.rotations[g])
        pybullet.createMultiBody(
            0.0, -1, visual, geoms.positions[g], orientation, physicsClientId=self._client
        )


def _frustum(camera: Camera) -> tuple[float, float, float, float, float, float]:
    """Return left, right, bottom and top of the near plane, and the distances near and far.

    TinyRenderer's rays pass through the lower left corners of its pixels: the frustum is shifted by
    half a pixel, so that they are those of `Camera`, through the centres.
    """
    near, far = camera.near_m, camera.far_m
    x, y = near * float(camera.lens.tan_x), near * float(camera.lens.tan_y)
    right, up = x / camera.width, y / camera.height
    return -x + right, x + right, -y + up, y + up, near, far
