"""A fixed workload, measured beside each rollout: ratios to it can be compared between machines."""

from __future__ import annotations

import numpy as np

from veca_marl.bench.stopwatch import thread_ms
from veca_marl.sim.physics import pybullet

_SPHERES = 20
_STEPS = 100
_RADIUS_M = 0.1


class ReferenceWorkload:
    """PyBullet steps of falling spheres, and numpy arithmetic: the two kinds of work of a step."""

    def __init__(self) -> None:
        self._client: int = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        sphere = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=_RADIUS_M, physicsClientId=self._client
        )
        floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        pybullet.createMultiBody(0.0, floor, physicsClientId=self._client)
        self._spheres = [
            pybullet.createMultiBody(1.0, sphere, physicsClientId=self._client)
            for _ in range(_SPHERES)
        ]
        self._matrix = np.random.default_rng(0).random((84, 84))

    def run_ms(self) -> float:
        """Return the milliseconds of processor time of one run; each run does the same work."""
        for number, body in enumerate(self._spheres):
            height = _RADIUS_M * (1 + 2 * number)
            pybullet.resetBasePositionAndOrientation(
                body, (0.01 * (number % 2), 0.0, height), (0, 0, 0, 1), physicsClientId=self._client
            )
        return thread_ms(self._work)

    def _work(self) -> None:
        for _ in range(_STEPS):
            pybullet.stepSimulation(physicsClientId=self._client)
            np.tanh(self._matrix @ self._matrix)

    def close(self) -> None:
        """Disconnect from PyBullet."""
        pybullet.disconnect(self._client)
