"""What can stand, lie or roll in a room, described as data, and the handle to it in a world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.primitives import Shape
from veca_marl.sim.geometry.rotations import quaternion_from_yaw, quaternions_to_matrices
from veca_marl.sim.geometry.scene import Scene
from veca_marl.sim.geometry.tables import Geom
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.collision_shapes import create_collision_shape
from veca_marl.sim.sound.obstacles import Obstacles
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.sounds import SoundCfg

SOUND_OBSTACLE_M = (0.7, 1.0)
"""Least width and height of a box that stops sound as a wall does. Sound below 340 Hz, with waves
longer than a metre, bends round anything smaller; furniture that is lower is not in the way."""


class PropShape(Enum):
    """Shapes of props; what `PropCfg.size_m` means depends on it."""

    sphere = "sphere"
    box = "box"
    cylinder = "cylinder"
    capsule = "capsule"
    wall = "wall"
    goal = "goal"


SIZE_NAMES: dict[PropShape, tuple[str, ...]] = {
    PropShape.sphere: ("radius",),
    PropShape.box: ("length_x", "length_y", "height"),
    PropShape.cylinder: ("radius", "height"),
    PropShape.capsule: ("radius", "length"),
    PropShape.wall: ("length", "thickness", "height"),
    PropShape.goal: ("width", "height", "bar_radius"),
}


@dataclass
class PropCfg:
    """One prop.

    Attributes:
        name: Unique in its world.
        shape: What it is.
        size_m: Lengths in metres, see `SIZE_NAMES`: a box has full edge lengths, a capsule the
            distance of its cap centres. Cylinders, capsules and goal posts stand along z.
        position_m: Centre of the shape; for walls and goals the middle of the foot line.
        yaw_deg: Turn about z.
        mass_kg: 0 makes it a fixed part of the world.
        friction: Sliding friction coefficient (Coulomb) on the floor. Bullet multiplies those of
            two things that touch; the floor's is 1.
        rolling_friction: Arm of the resistance to rolling and to spinning on the floor, metres.
        restitution: 0 (dead) to 1 (bounces back with equal speed) on the floor; multiplied as
            well, the floor's is 1.
        colour: Red, green, blue in [0, 1].
        checker_m: Edge of a checker pattern; 0 is plain.
        transparent: Seen through, and no hindrance to `is_visible`.
        tangible: Whether it collides, is felt and stops sound; a mark on the floor is only seen.
        sound: What it emits; None is a silent thing.
    """

    name: str = ""
    shape: PropShape = PropShape.box
    size_m: list[float] = field(default_factory=list)
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    mass_kg: float = 0.0
    friction: float = 0.6
    rolling_friction: float = 0.001
    restitution: float = 0.3
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    checker_m: float = 0.0
    transparent: bool = False
    tangible: bool = True
    sound: SoundCfg | None = None

    def __post_init__(self) -> None:
        """Check what physics could not explain later."""
        if not isinstance(self.shape, PropShape):
            shapes = [shape.name for shape in PropShape]
            raise ValueError(f"prop {self.name!r}: shape={self.shape!r}; there are {shapes}")
        names = SIZE_NAMES[self.shape]
        if len(self.size_m) != len(names) or not all(
            math.isfinite(size) and size > 0 for size in self.size_m
        ):
            raise ValueError(
                f"prop {self.name!r}: size_m={list(self.size_m)} of a {self.shape.value} "
                f"must be {len(names)} positive lengths: {', '.join(names)}"
            )
        if not all(math.isfinite(value) for value in (*self.position_m, self.yaw_deg)):
            raise ValueError(
                f"prop {self.name!r}: position_m={tuple(self.position_m)}, yaw_deg={self.yaw_deg} "
                "must be finite"
            )
        for quantity in ("mass_kg", "friction", "rolling_friction"):
            value = getattr(self, quantity)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"prop {self.name!r}: {quantity}={value} is not 0 or more")
        if not 0.0 <= self.restitution <= 1.0:
            raise ValueError(f"prop {self.name!r}: restitution={self.restitution} is not in [0, 1]")
        if not self.tangible and self.mass_kg > 0.0:
            raise ValueError(
                f"prop {self.name!r}: mass_kg={self.mass_kg}, but what is not tangible would fall "
                "through the floor: it must be fixed (mass_kg=0)"
            )
        if not self.name:
            raise ValueError(f"a {self.shape.value} without a name; every prop has one")


def prop_geoms(cfg: PropCfg) -> tuple[Geom, ...]:
    """Return the primitives of a prop in its own frame."""
    size = tuple(cfg.size_m)
    look: dict[str, Any] = {
        "colour": tuple(cfg.colour),
        "checker_m": cfg.checker_m,
        "transparent": cfg.transparent,
        "tangible": cfg.tangible,
    }
    match cfg.shape:
        case PropShape.sphere:
            return (Geom(Shape.SPHERE, size, **look),)
        case PropShape.box:
            return (Geom(Shape.BOX, tuple(s / 2 for s in size), **look),)
        case PropShape.cylinder:
            return (Geom(Shape.CYLINDER, size, **look),)
        case PropShape.capsule:
            return (Geom(Shape.CAPSULE, size, **look),)
        case PropShape.wall:
            half = tuple(s / 2 for s in size)
            return (Geom(Shape.BOX, half, offset=(0.0, 0.0, half[2]), **look),)
        case PropShape.goal:
            return _goal_geoms(size, look)


def stops_sound(cfg: PropCfg) -> bool:
    """Return whether a prop attenuates sound between rooms: a wall or a large box, such as a door.

    See `SOUND_OBSTACLE_M`.
    """
    if cfg.shape is not PropShape.box:
        return cfg.tangible and cfg.shape is PropShape.wall
    length_x, length_y, height = cfg.size_m
    width_m, height_m = SOUND_OBSTACLE_M
    return cfg.tangible and max(length_x, length_y) >= width_m and height >= height_m


def _goal_geoms(size: tuple[float, ...], look: dict[str, Any]) -> tuple[Geom, ...]:
    """Two posts and a bar; the mouth of the goal faces x, its width lies along y."""
    width, height, radius = size
    posts = [
        Geom(Shape.CYLINDER, (radius, height), offset=(0.0, side * width / 2, height / 2), **look)
        for side in (-1.0, 1.0)
    ]
    along_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    bar = Geom(Shape.CYLINDER, (radius, width), offset=(0.0, 0.0, height), rotation=along_y, **look)
    return (*posts, bar)


class _Obstacle:
    """The box of a prop among the obstacles of the sound."""

    def __init__(self, box: Geom, obstacles: Obstacles) -> None:
        self._offset = np.asarray(box.offset)
        self._obstacles = obstacles
        self._number = obstacles.add(box.size)

    def move(self, position: Floats, rotation: Floats) -> None:
        """Follow the frame of the prop."""
        self._obstacles.move(self._number, position + rotation @ self._offset, rotation)


class Prop:
    """A prop in a world: read where it is and put it somewhere else.

    Attributes:
        cfg: What it was made from.
        body_id: PyBullet's id.
        object_id: Its value in segmentation images.
        sound: Its sound source; None for a silent thing.
    """

    def __init__(
        self,
        cfg: PropCfg,
        client: int,
        scene: Scene,
        sound: Source | None,
        obstacles: Obstacles,
    ) -> None:
        self.cfg = cfg
        self.sound = sound
        self._client = client
        self._scene = scene
        geoms = prop_geoms(cfg)
        self._obstacle = _Obstacle(geoms[0], obstacles) if stops_sound(cfg) else None
        drawn = scene.add_object(cfg.name, [geoms])
        self.object_id = drawn.id
        self._row = drawn.rows.start
        self.body_id: int = pybullet.createMultiBody(
            cfg.mass_kg, create_collision_shape(client, geoms), physicsClientId=client
        )
        pybullet.changeDynamics(
            self.body_id,
            -1,
            lateralFriction=cfg.friction,
            rollingFriction=cfg.rolling_friction,
            spinningFriction=cfg.rolling_friction,
            restitution=cfg.restitution,
            linearDamping=0.0,
            angularDamping=0.0,  # only friction slows things down
            physicsClientId=client,
        )
        if not cfg.tangible:
            pybullet.setCollisionFilterGroupMask(self.body_id, -1, 0, 0, physicsClientId=client)
        self.place(cfg.position_m, math.radians(cfg.yaw_deg))

    @property
    def name(self) -> str:
        """The name given in its configuration."""
        return self.cfg.name

    @property
    def fixed(self) -> bool:
        """Whether it is part of the building."""
        return self.cfg.mass_kg == 0.0

    @property
    def radius_m(self) -> float:
        """Horizontal radius of the cylinder round the shape."""
        size = self.cfg.size_m
        if self.cfg.shape in (PropShape.box, PropShape.wall):
            return math.hypot(size[0], size[1]) / 2
        return size[0] / 2 if self.cfg.shape is PropShape.goal else size[0]

    @property
    def lowest_m(self) -> float:
        """Height of its lowest point."""
        low, _ = pybullet.getAABB(self.body_id, physicsClientId=self._client)
        return float(low[2])

    @property
    def position(self) -> Floats:
        """``(3,)`` metres, world frame."""
        return np.array(self._scene.positions[self._row])

    @property
    def rotation(self) -> Floats:
        """``(3, 3)`` rotation to the world frame."""
        return np.array(self._scene.rotations[self._row])

    @property
    def velocity(self) -> Floats:
        """``(3,)`` m/s, world frame."""
        linear, _ = pybullet.getBaseVelocity(self.body_id, physicsClientId=self._client)
        return np.array(linear)

    def touches(self, body_id: int) -> bool:
        """Say whether it met something, by PyBullet's id, in the last physics step."""
        points = pybullet.getContactPoints(self.body_id, body_id, physicsClientId=self._client)
        return bool(points)

    def place(
        self,
        position: Sequence[float] | Floats,
        yaw_rad: float = 0.0,
        velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    ) -> None:
        """Put the prop somewhere, moving as told; its sound does not glide there.

        Args:
            position: ``(3,)`` metres.
            yaw_rad: Turn about z; other turns are undone.
            velocity: ``(3,)`` m/s.
            angular_velocity: ``(3,)`` rad/s.

        Raises:
            ValueError: If a number is not finite.
        """
        x, y, z = _three_finite(self.name, "position", position)
        turn = quaternion_from_yaw(yaw_rad)
        pybullet.resetBasePositionAndOrientation(
            self.body_id, (x, y, z), turn, physicsClientId=self._client
        )
        self.push(velocity, angular_velocity)
        self.mirror()
        if self.sound is not None:
            self.sound.teleport(self.position)

    def push(
        self,
        velocity: Sequence[float] | Floats,
        angular_velocity: Sequence[float] | Floats = (0.0, 0.0, 0.0),
    ) -> None:
        """Set the velocity (m/s) and the angular velocity (rad/s). Fixed props stay."""
        if not self.fixed:
            pybullet.resetBaseVelocity(
                self.body_id,
                _three_finite(self.name, "velocity", velocity),
                _three_finite(self.name, "angular velocity", angular_velocity),
                physicsClientId=self._client,
            )

    def mirror(self) -> None:
        """Copy the pose from the physics to the scene, the sound source and the obstacle."""
        mirror([self])


def mirror(props: Sequence[Prop]) -> None:
    """Do what `Prop.mirror` does for many props of one world, at 0.4 of the price."""
    if not props:
        return
    client, scene = props[0]._client, props[0]._scene
    poses = [
        pybullet.getBasePositionAndOrientation(prop.body_id, physicsClientId=client)
        for prop in props
    ]
    rows = np.array([prop._row for prop in props])
    matrices = np.empty((len(props), 3, 3))
    quaternions_to_matrices(np.array([quaternion for _, quaternion in poses]), matrices)
    scene.positions[rows] = [position for position, _ in poses]
    scene.rotations[rows] = matrices
    for prop in props:
        if prop.sound is not None:
            prop.sound.position = scene.positions[prop._row]
        if prop._obstacle is not None:
            prop._obstacle.move(scene.positions[prop._row], scene.rotations[prop._row])


def _three_finite(name: str, what: str, vector: Sequence[float] | Floats) -> list[float]:
    numbers = [float(value) for value in vector]
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"prop {name!r}: {what} {numbers} must be three finite numbers")
    return numbers
