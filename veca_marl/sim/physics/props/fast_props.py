"""Small props that are so fast that they could pass through thin things between two physics steps.

Bullet looks for contacts where things are at the beginning of a physics step. Its own continuous
collision detection (`ccdSweptSphereRadius`) moves rigid bodies only, and props are multibodies.
Hence a prop that would move by more than half its size in a physics step, and whose centre would
meet something in it, is moved there before the step: Bullet finds the contact and solves it with
the whole velocity. The prop is early by less than a physics step.
"""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry import Scene
from veca_marl.sim.physics.bullet import free_path_m
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.physics.props.prop import Prop

# props that are too large to pass through things at the speed after a fall of 5 m are ignored
_FASTEST_MPS = 10.0
_FAST = 0.5  # of the speed from which a prop could pass through: it may gain speed in a step
_DEPTH_M = 1e-5  # in what it meets, so that Bullet finds the contact


class FastProps:
    """The props of one world that can be too fast, and what keeps them on their side of things.

    Args:
        client: The PyBullet client.
        scene: Where the props are at the end of an agent step.
        substep_s: Duration of a physics step.
    """

    def __init__(self, client: BulletClient, scene: Scene, substep_s: float) -> None:
        self._client, self._scene, self._substep_s = client, scene, substep_s
        self._small: list[Prop] = []
        self._fast: list[Prop] = []
        self._rows: list[int] = []
        self._moved_m, self._positions = np.zeros(0), np.zeros((0, 3))

    def add(self, prop: Prop) -> None:
        """Add a prop, if it is loose and small enough to be too fast."""
        is_small = prop.half_size_m < _FASTEST_MPS * self._substep_s
        if is_small and not prop.fixed and prop.joint is None:
            self._small.append(prop)
            self._rows.append(prop.row)
            self._moved_m = np.array([_FAST * each.half_size_m for each in self._small])
            self._positions = np.full((len(self._rows), 3), np.inf)

    def before_step(self) -> None:
        """Find the props that are fast at the beginning of an agent step.

        Only the velocities of those are read that have moved in the last one by the distance that
        a fast prop moves in a physics step, or whose velocity has been set.
        """
        if not self._small:
            return
        positions = self._scene.positions[self._rows]
        moved = np.abs(positions - self._positions).max(axis=1) > self._moved_m
        self._positions = positions
        self._fast = [
            prop
            for prop, has_moved in zip(self._small, moved.tolist(), strict=True)
            if (has_moved or prop.was_launched) and self._is_fast(prop)
        ]

    def _is_fast(self, prop: Prop) -> bool:
        prop.was_launched = False
        speed_mps = float(np.linalg.norm(prop.velocity))
        return speed_mps * self._substep_s > _FAST * prop.half_size_m

    def before_substep(self) -> None:
        """Move props that would meet something in the next physics step to where they meet it."""
        for prop in self._fast:
            if prop.holder is None:
                self._advance(prop, prop.half_size_m)

    def _advance(self, prop: Prop, half_m: float) -> None:
        velocity, spin = self._client.getBaseVelocity(prop.body_id)
        way = np.array(velocity) * self._substep_s
        length_m = float(np.linalg.norm(way))
        if not half_m < length_m < math.inf:  # a broken simulation is noticed after the step
            return
        position, orientation = self._client.getBasePositionAndOrientation(prop.body_id)
        start = np.array(position)
        free_m = free_path_m(self._client, start, start + way, half_m, prop.body_id) + _DEPTH_M
        if _DEPTH_M < free_m < length_m:
            place = (start + free_m / length_m * way).tolist()
            self._client.resetBasePositionAndOrientation(prop.body_id, place, orientation)
            self._client.resetBaseVelocity(prop.body_id, velocity, spin)
