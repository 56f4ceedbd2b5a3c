"""The walking body against things: light ones are pushed by physics, heavy ones stop the walker.

The paper's collision rule of the animation-based agent: against a light object the agent is
kinematic and pushes it; against a heavy one the object is kinematic and pushes the agent out.
The body is a capsule without mass that is moved by hand. Its velocity is told to Bullet, so light
things are pushed correctly; contacts with heavy and fixed things are switched off in Bullet and
solved here, by moving the capsule out of them along the horizontal.

A joint-level body is a thing like others: its whole mass, 10 kg, is above the usual limit, so it is
heavy. It does not feel the walker and shoves it aside, by standing, walking or falling; only walls
hold a walker against it. With a limit above its mass it is light: the walker shoves it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.primitives import Primitive, Shape
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.collision_shapes import create_collision_shape
from veca_marl.sim.physics.props import Prop

_ROUNDS = 3  # two walls of a corner and one to spare
_LIMBS_M = 1.0  # how far a joint-level body reaches from its pelvis, toes stretched
_SIGHT_M = 0.06  # how far another body or a heavy thing may shove it within one agent step


class Pusher:
    """The capsule of a walking body and what it knows of the obstacles around it."""

    def __init__(self, client: int, radius_m: float, height_m: float, push_limit_kg: float) -> None:
        self.radius_m = radius_m
        # the lower cap is beneath the floor, which it does not meet: round feet would press what
        # they push into the ground
        length_m = height_m - radius_m
        self.centre_height_m = length_m / 2
        self._client = client
        self._push_limit_kg = push_limit_kg
        capsule = Primitive(Shape.CAPSULE, (radius_m, length_m))
        shape = create_collision_shape(client, [capsule])
        self.body_id: int = pybullet.createMultiBody(0, shape, physicsClientId=client)
        pybullet.changeDynamics(
            self.body_id, -1, lateralFriction=0.2, restitution=0.0, physicsClientId=client
        )
        # PyBullet's ids and how far each reaches beyond the box round its base
        self._obstacles: list[tuple[int, float]] = []
        self._known = (0, 0)
        self._near: list[int] = []

    def look_round(
        self, props: dict[str, Prop], jointed: Sequence[int], position: Floats, way_m: float
    ) -> None:
        """Note which obstacles can be met within this agent step.

        Args:
            props: All props of the world.
            jointed: PyBullet's ids of all joint-level bodies.
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            way_m: How far it wants to go.
        """
        if (len(props), len(jointed)) != self._known:
            self._meet(props, jointed)
        x, y = position[0], position[1]
        self._near = []
        for body_id, beyond_m in self._obstacles:
            low, high = pybullet.getAABB(body_id, physicsClientId=self._client)
            reach = self.radius_m + _SIGHT_M + way_m + beyond_m
            if low[0] - reach < x < high[0] + reach and low[1] - reach < y < high[1] + reach:
                self._near.append(body_id)

    def move(self, x: float, y: float) -> tuple[float, float]:
        """Put the capsule at a wished place; return where obstacles let it stand, metres."""
        self._put(x, y)
        for _ in range(_ROUNDS):
            out_x, out_y = self._way_out()
            if out_x == 0.0 and out_y == 0.0:
                break
            x, y = x + out_x, y + out_y
            self._put(x, y)
        return x, y

    def tell_velocity(self, vx: float, vy: float, turn_radps: float) -> None:
        """Tell Bullet how the capsule moves, so that it pushes light things correctly."""
        pybullet.resetBaseVelocity(
            self.body_id, (vx, vy, 0.0), (0.0, 0.0, turn_radps), physicsClientId=self._client
        )

    def _put(self, x: float, y: float) -> None:
        pybullet.resetBasePositionAndOrientation(
            self.body_id,
            (x, y, self.centre_height_m),
            (0.0, 0.0, 0.0, 1.0),
            physicsClientId=self._client,
        )

    def _way_out(self) -> tuple[float, float]:
        """Return the horizontal displacement out of everything the capsule is stuck in."""
        out_x = out_y = 0.0
        for body_id in self._near:
            for contact in pybullet.getClosestPoints(
                self.body_id, body_id, 0.0, physicsClientId=self._client
            ):
                normal, depth = contact[7], -contact[8]
                length = math.hypot(normal[0], normal[1])
                if depth > 1e-6 and length > 0.1:
                    # several points of one face tell the same way out: the greatest counts
                    way_x, way_y = normal[0] / length * depth, normal[1] / length * depth
                    out_x = _farther(out_x, way_x)
                    out_y = _farther(out_y, way_y)
        return out_x, out_y

    def _meet(self, props: dict[str, Prop], jointed: Sequence[int]) -> None:
        """Switch Bullet's contacts off for all that cannot be pushed."""
        self._known = len(props), len(jointed)
        limit_kg = self._push_limit_kg
        solid = [p for p in props.values() if p.cfg.tangible]  # not paint on the floor
        things = [p.body_id for p in solid if p.fixed or p.cfg.mass_kg > limit_kg]
        bodies = [one for one in jointed if _mass_kg(self._client, one) > limit_kg]
        self._obstacles = [(one, 0.0) for one in things] + [(one, _LIMBS_M) for one in bodies]
        for body_id, _ in self._obstacles:
            for link in range(-1, pybullet.getNumJoints(body_id, physicsClientId=self._client)):
                pybullet.setCollisionFilterPair(
                    self.body_id, body_id, -1, link, 0, physicsClientId=self._client
                )


def _mass_kg(client: int, body_id: int) -> float:
    """Return the mass of a body with all its links."""
    links = range(-1, pybullet.getNumJoints(body_id, physicsClientId=client))
    masses = [pybullet.getDynamicsInfo(body_id, n, physicsClientId=client)[0] for n in links]
    return float(sum(masses))


def _farther(a: float, b: float) -> float:
    return a if abs(a) >= abs(b) else b


def horizontal_distance(a: Floats, b: Floats) -> float:
    """Return the distance of two points on the floor plan, metres."""
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))
