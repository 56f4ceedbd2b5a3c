"""PyBullet's software renderer applied to a `Scene`."""

import numpy as np

from veca_marl.sim.geometry import Shape, matrix_to_quaternion
from veca_marl.sim.physics import pybullet, shape_arguments


class TinyRenderer:
    """Renders the primitives of a scene as bodies with the indices of the primitives as ids."""

    def __init__(self, scene):
        self.client = pybullet.connect(pybullet.DIRECT)
        for g in range(len(scene.geoms.shapes)):
            assert self._add(scene.geoms, g) == g

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pybullet.disconnect(self.client)

    def segment(self, camera, pose):
        """Return the index of the visible primitive per pixel, ``(H, W)``, -1 for none."""
        forward, _, up = pose.rotation.T
        view = pybullet.computeViewMatrix(pose.position, pose.position + forward, up)
        projection = pybullet.computeProjectionMatrixFOV(
            camera.fov_deg, camera.width / camera.height, camera.near_m, camera.far_m
        )
        *_, segmentation = pybullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            projection,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        return np.reshape(segmentation, (camera.height, camera.width))

    def _add(self, geoms, g):
        kind = shape_arguments(Shape(geoms.shapes[g]), geoms.sizes[g])
        visual = pybullet.createVisualShape(**kind, physicsClientId=self.client)
        orientation = matrix_to_quaternion(geoms.rotations[g])
        return pybullet.createMultiBody(
            0.0, -1, visual, geoms.positions[g], orientation, physicsClientId=self.client
        )
