"""The collision capsule of a walker: light props are pushed, heavy obstacles stop the walker.

Doors and drawers that are light enough are pushed as well, as long as they can move: a leaf that is
locked, or pushed against its stop, stops the walker. So does every light thing that is jammed
between the walker and something else, see `JammedProps`.

The paper's collision rule of the animation-based agent: against a light object the agent is
kinematic and pushes it; against a heavy one the object is kinematic and pushes the agent out.
The capsule has no mass and its position is set at each physics step. Its velocity is set in Bullet
too, so that Bullet pushes light props correctly. Contacts with heavy and fixed obstacles are
disabled in Bullet; here the capsule is moved horizontally until it no longer penetrates them.

A joint-level body counts with its whole mass of 10 kg, which is above the default limit: it is a
heavy obstacle that walkers do not move and that displaces them when it moves or falls. With a limit
above its mass walkers push it.

What moves displaces a walker only as far as fixed things allow: these it neither enters nor passes,
whatever pushes it. A heavy thing that presses it against one is stopped, see `Stop`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import chain

import numpy as np

from veca_marl.sim.body.walker.jammed import (
    FIRM_M,
    JammedProps,
    Overlap,
    deepest_m,
    depenetration,
    make_way,
    may_reach,
)
from veca_marl.sim.body.walker.obstacles import PARKED_M, Leaves, ObstacleBoxes, Stop
from veca_marl.sim.body.walker.walker_collisions import Footprint
from veca_marl.sim.geometry import (
    Floats,
    Primitive,
    Scene,
    Shape,
    horizontal_distance,
)
from veca_marl.sim.physics import Prop, World, create_collision_shape
from veca_marl.sim.physics.bullet_client import BulletClient, ContactPoint

DISPLACED_M = 0.06
"""A moving obstacle may displace the capsule by so much within an agent step."""

_ROUNDS = 3  # two for the walls of a corner, one spare
_LIMB_REACH_M = 1.0  # from the pelvis of a joint-level body to its stretched toes
_GAP_M = 0.01  # more than the margins of Bullet's shapes
_CARPET_M = 0.02  # what is lower is walked over
_DEPTH_M = 1e-6  # less is rounding
_TOUCH_M = 0.005  # what stops it is left so near at most


class Capsule:
    """The capsule of one walker and the obstacles near it.

    Args:
        client: The PyBullet client.
        scene: The scene that shows the props.
        form: The capsule, in a frame with the walker's heading as x axis.
        centre_height_m: Height of its centre above the surface on which the walker is.
        push_limit_kg: Props up to this mass are pushed.
        restitution: Multiplied by that of what touches it.

    Attributes:
        body_id: PyBullet's id.
        base_m: Height of the surface on which the walker is; 0 on the floor.
        radius_m: Radius about its axis.
        yaw_rad: Rotation about the vertical.
        support_id: PyBullet's id of the prop on which the walker stands, which is no obstacle; -1
            on the floor.
        walked_over: Likewise of the things that it walks over.
        is_clear: Whether nothing but other walkers can be met within this agent step.
    """

    def __init__(
        self,
        client: BulletClient,
        scene: Scene,
        form: Primitive,
        centre_height_m: float,
        push_limit_kg: float,
        restitution: float,
    ) -> None:
        self._centre_height_m = centre_height_m
        self.base_m = self.yaw_rad = 0.0
        self.support_id = -1
        self.walked_over: Collection[int] = ()
        self._client, self._scene = client, scene
        self._push_limit_kg = push_limit_kg
        shape = create_collision_shape(client, [form])
        self.body_id: int = client.createMultiBody(0, shape)
        client.changeDynamics(self.body_id, -1, lateralFriction=0.2, restitution=restitution)
        self.radius_m, self._half_axis_m = form.radius, _half_axis_m(form)
        self._reach_m = self._half_axis_m + form.radius
        self._obstacles = ObstacleBoxes(client, scene, [], [], _LIMB_REACH_M)
        self._leaves = Leaves([])
        self._jammed = JammedProps(client, scene, self.body_id, [], [])
        self._stop = Stop(client, shape)
        self._known = (0, 0)
        self._capsules: Collection[int] = ()
        # heavy things that move by themselves: their leaves, and None for loose ones and bodies
        self._heavy: dict[int, Prop | None] = {}
        self._near: list[int] = []
        self._near_leaves: list[Prop] = []
        self._squeezed = False
        self.is_clear = False

    @property
    def footprint(self) -> Footprint:
        """Its outline on the floor plan, at its present heading."""
        x, y = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Footprint(self.radius_m, (self._half_axis_m * x, self._half_axis_m * y))

    def collect_obstacles(
        self,
        props: dict[str, Prop],
        bodies: Sequence[int],
        capsules: Collection[int],
        position: Floats,
        distance_m: float,
        approach_m: float = 0.0,
    ) -> None:
        """Collect the obstacles that can be reached within this agent step.

        Args:
            props: All props of the world.
            bodies: PyBullet's ids of all joint-level bodies.
            capsules: PyBullet's ids of the capsules of all walkers.
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            distance_m: The distance that the walker covers without obstacles.
            approach_m: The distance by which things that move come nearer.
        """
        if (len(props), len(bodies)) != self._known:
            self._find_obstacles(props, bodies)
        self._capsules = capsules
        self._squeezed = False
        reach_m = self._reach_m + DISPLACED_M + distance_m + approach_m
        near = self._obstacles.near(position, reach_m)
        self._near = [body_id for body_id in near if body_id != self.support_id]
        self.leave_out(self.walked_over)
        self._near_leaves = self._leaves.near(position, reach_m)
        self._jammed.collect(position, reach_m, self._near_leaves, capsules)
        free_m = self._reach_m + distance_m + _GAP_M
        farther = self._obstacles.are_farther(position, free_m)
        self.is_clear = farther and not self._jammed.are_near

    @property
    def reach_m(self) -> float:
        """Distance from its centre to its farthest point, on the floor plan."""
        return self._reach_m

    @property
    def near(self) -> Sequence[int]:
        """PyBullet's ids of the obstacles that can be reached within this agent step."""
        return self._near

    def leave_out(self, walked_over: Collection[int]) -> None:
        """Take things that the walker walks over from the obstacles."""
        self.walked_over = walked_over
        if walked_over:
            self._near = [body_id for body_id in self._near if body_id not in walked_over]

    def solid_near(self, position: Floats, reach_m: float) -> list[int]:
        """Return PyBullet's ids of what is within a horizontal distance and is not pushed.

        These are obstacles, doors, drawers and the capsules of other walkers.

        Args:
            position: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
            reach_m: Metres.
        """
        leaves = [leaf.body_id for leaf in self._leaves.near(position, reach_m)]
        others = [
            body_id
            for body_id in self._capsules
            if body_id != self.body_id
            and horizontal_distance(self._centre(body_id), position) < reach_m + _LIMB_REACH_M
        ]
        return [*self._obstacles.near(position, reach_m), *leaves, *others]

    def resolve_contacts(
        self, x: float, y: float, last: tuple[float, float] | None = None
    ) -> tuple[float, float]:
        """Set the position and move the capsule out of obstacles; return the new position.

        Args:
            x: Metres.
            y: Metres.
            last: Position at the end of the last physics step: the capsule stays on that side of
                fixed things. None if it is placed: then there is no side.
        """
        asked = x, y
        self.move_to(x, y)
        self._squeezed = False
        for _ in range(_ROUNDS):
            out_x, out_y = depenetration(chain(self._overlaps(), self._jammed.overlaps()))
            if out_x == 0.0 and out_y == 0.0:
                if last is None or may_reach(self, (x, y), last):
                    return x, y
                break
            x, y = x + out_x, y + out_y
            self.move_to(x, y)
        if last is None:
            return x, y
        x, y = make_way(self, asked, (x, y), last)
        self._squeezed = deepest_m(self.pushes()) > FIRM_M
        return x, y

    def room_for_others(self) -> tuple[float, float]:
        """Return by how much it makes room for what it and other walkers press together, metres."""
        return depenetration(self._jammed.squeezes())

    def set_velocity(self, vx: float, vy: float, turn_radps: float) -> None:
        """Set the velocity with which Bullet computes contacts with light props.

        Bullet moves the capsule by this velocity in the physics step, which would press a jammed
        thing further: then it is at rest. So it is if something heavy presses it against something
        fixed; that is stopped in the physics step.
        """
        if self._jammed.found or self._squeezed:
            vx = vy = turn_radps = 0.0
        if self._squeezed:
            self._stop.put(*self._client.getBasePositionAndOrientation(self.body_id))
        else:
            self._stop.park()
        self._jammed.forget()
        self._client.resetBaseVelocity(self.body_id, (vx, vy, 0.0), (0.0, 0.0, turn_radps))

    def overlaps(self, x: float, y: float) -> bool:
        """Move it to a place, and return whether it penetrates an obstacle there.

        A carpet, which is as low as what it stands on, does not count.
        """
        self.move_to(x, y)
        if depenetration(self._overlaps()) != (0.0, 0.0):
            return True
        # in the middle of something wide the nearest way out is vertical
        high = [body_id for body_id in self._near if self._rises(body_id)]
        return any(-c.distance_m > _DEPTH_M for body_id in high for c in self._contacts(body_id))

    def _rises(self, body_id: int) -> bool:
        """Return whether a body is higher than the surface on which the walker is."""
        _, highest = self._client.getAABB(body_id)
        return float(highest[2]) > self.base_m + _CARPET_M

    def park(self) -> None:
        """Move it far below the floor, where it collides with nothing."""
        self._jammed.forget()
        self._squeezed = False
        self._put((0.0, 0.0, PARKED_M))
        self.set_velocity(0.0, 0.0, 0.0)

    def move_to(self, x: float, y: float) -> None:
        """Move it to a place on the surface on which the walker is; nothing is resolved."""
        self._put((x, y, self.base_m + self._centre_height_m))

    def _put(self, position: tuple[float, float, float]) -> None:
        half_rad = 0.5 * self.yaw_rad
        orientation = (0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
        self._client.resetBasePositionAndOrientation(self.body_id, position, orientation)

    def _centre(self, body_id: int) -> Floats:
        """Return the position ``(3,)`` of a body, metres."""
        position, _ = self._client.getBasePositionAndOrientation(body_id)
        return np.array(position)

    def _overlaps(self) -> Iterator[Overlap]:
        """Yield how deep it is in obstacles, and in doors and drawers that cannot yield."""
        for body_id in self._near:
            for contact in self._contacts(body_id):
                yield contact.normal_on_b, -contact.distance_m
        for leaf in self._near_leaves:
            for contact in self._contacts(leaf.body_id):
                if not _yields(leaf, contact):
                    yield contact.normal_on_b, -contact.distance_m

    def firm_overlaps(self) -> Iterator[Overlap]:
        """Yield how deep it is in what is fixed, or a door or drawer that cannot yield."""
        for body_id in self._near:
            if body_id not in self._heavy:
                for contact in self._contacts(body_id):
                    yield contact.normal_on_b, -contact.distance_m
        heavy = (self._heavy.get(body_id) for body_id in self._near)
        for leaf in chain(self._near_leaves, (prop for prop in heavy if prop is not None)):
            for contact in self._contacts(leaf.body_id):
                if not _yields(leaf, contact):
                    yield contact.normal_on_b, -contact.distance_m

    def pushes(self) -> Iterator[Overlap]:
        """Yield by how much heavy things that move, and jammed things, displace it."""
        for body_id in self._near:
            if body_id in self._heavy:
                leaf = self._heavy[body_id]
                for contact in self._contacts(body_id):
                    if leaf is None or _yields(leaf, contact):
                        yield contact.normal_on_b, -contact.distance_m
        yield from self._jammed.overlaps()

    def _contacts(self, body_id: int) -> tuple[ContactPoint, ...]:
        """Return PyBullet's points of contact with a body; normals point to the capsule."""
        return self._client.getClosestPoints(self.body_id, body_id, 0.0)

    def touches_obstacle(self, body_id: int) -> bool:
        """Return whether it is at something that stops it, with which Bullet has no contacts."""
        if body_id not in self._obstacles.ids:
            return False
        return bool(self._client.getClosestPoints(self.body_id, body_id, _TOUCH_M))

    def _find_obstacles(self, props: dict[str, Prop], bodies: Sequence[int]) -> None:
        """Find everything that cannot be pushed and disable Bullet's contacts with it."""
        self._known = len(props), len(bodies)
        limit_kg = self._push_limit_kg
        solid = [p for p in props.values() if p.cfg.tangible]
        things = [p for p in solid if p.fixed or p.cfg.mass_kg > limit_kg]
        heavy = [one for one in bodies if _mass_kg(self._client, one) > limit_kg]
        self._obstacles = ObstacleBoxes(self._client, self._scene, things, heavy, _LIMB_REACH_M)
        light = [p for p in solid if not p.fixed and p.cfg.mass_kg <= limit_kg]
        leaves = [p for p in light if p.joint is not None]
        self._leaves = Leaves(leaves)
        loose = [p for p in light if p.joint is None]
        self._jammed = JammedProps(self._client, self._scene, self.body_id, loose, leaves)
        self._heavy = {p.body_id: None if p.joint is None else p for p in things if not p.fixed}
        self._heavy |= dict.fromkeys(heavy)
        for body_id in self._obstacles.ids:
            for link in range(-1, self._client.getNumJoints(body_id)):
                self._client.setCollisionFilterPair(self.body_id, body_id, -1, link, 0)
                if body_id in self._heavy:
                    self._stop.let_stop(body_id, link)


def _yields(leaf: Prop, contact: ContactPoint) -> bool:
    """Return whether a door or drawer gives way to a capsule that presses on it."""
    return leaf.yields(contact.position_on_b, [-axis for axis in contact.normal_on_b])


def upright_capsule(
    world: World, radius_m: float, height_m: float, push_limit_kg: float, restitution: float
) -> Capsule:
    """Return the capsule of a walker that stands.

    Args:
        world: The world.
        radius_m: Radius.
        height_m: Height of its upper end above the floor.
        push_limit_kg: Props up to this mass are pushed.
        restitution: Multiplied by that of what touches it.
    """
    # the lower cap is beneath the floor, with which it does not collide: a rounded lower end would
    # press props into the floor
    length_m = height_m - radius_m
    form = Primitive(Shape.CAPSULE, (radius_m, length_m))
    return Capsule(world.client, world.scene, form, length_m / 2, push_limit_kg, restitution)


def lying_capsule(
    world: World, height_m: float, length_m: float, push_limit_kg: float, restitution: float
) -> Capsule:
    """Return the capsule of a walker that crawls: it lies along the heading.

    Args:
        world: The world.
        height_m: Its diameter.
        length_m: From end to end.
        push_limit_kg: Props up to this mass are pushed.
        restitution: Multiplied by that of what touches it.
    """
    size = (height_m / 2.0, length_m - height_m)
    along_x = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    form = Primitive(Shape.CAPSULE, size, rotation=along_x)
    return Capsule(world.client, world.scene, form, height_m / 2.0, push_limit_kg, restitution)


def _half_axis_m(form: Primitive) -> float:
    """Return the horizontal distance from the centre of a capsule to an end of its axis."""
    ends = form.cap_centres()
    return float(np.linalg.norm((ends[0] - ends[-1])[:2])) / 2.0


def _mass_kg(client: BulletClient, body_id: int) -> float:
    """Return the mass of a body with all its links."""
    links = range(-1, client.getNumJoints(body_id))
    masses = [client.getDynamicsInfo(body_id, n).mass_kg for n in links]
    return float(sum(masses))
