"""Scenes of toys in a room, and cameras that look at one of them from anywhere.

Nothing is simulated: a toy lies where it is put, and touches the floor.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from veca_marl.sim.body.sense_organs import MOUNTS_M
from veca_marl.sim.geometry import Floats, Pose, Scene, SceneObject, rotation_about_vertical
from veca_marl.sim.physics import PlaygroundCfg, World
from veca_marl.sim.physics.props.geoms import lowest_m, prop_geoms
from veca_marl.sim.physics.props.toys import ToyKind, toy
from veca_marl.sim.vision import Camera, Eyes, Views, VisionCfg, look_at
from veca_marl.sim.vision.image_filters import FilterContext
from veca_marl.sim.vision.vision_sense import make_filters

_WALL_M = 0.2  # cameras and toys keep this distance from the walls
_EYE_ASIDE_M = MOUNTS_M["eye_left"][1]
INTERPUPILLARY_M = 2.0 * _EYE_ASIDE_M
"""Distance of the eyes of the bodies."""


@dataclass(frozen=True)
class Floor:
    """The part of the floor of a room on which things are put.

    Attributes:
        low: ``(2,)`` metres, its corner with the least coordinates.
        high: ``(2,)`` metres, the opposite one.
        ceiling_m: Height of the room.
    """

    low: Floats
    high: Floats
    ceiling_m: float

    @classmethod
    def of(cls, playground: PlaygroundCfg) -> Floor:
        """Return the floor of the first room."""
        room = playground.rooms[0]
        low = np.array(room.lower_m[:2]) + _WALL_M
        return cls(low, low + np.array(room.size_m[:2]) - 2.0 * _WALL_M, float(room.size_m[2]))

    def draw(self, rng: np.random.Generator) -> Floats:
        """Return a point ``(2,)`` of it."""
        return rng.uniform(self.low, self.high)

    def contains(self, point: Floats) -> bool:
        """Return whether a point ``(2,)`` or ``(3,)`` is above it."""
        return bool((point[:2] >= self.low).all() and (point[:2] <= self.high).all())


def empty_room(playground: PlaygroundCfg) -> Scene:
    """Return the scene of a playground without toys or bodies."""
    world = World(playground)
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.refresh()
    world.close()
    return world.scene


def random_rotation(rng: np.random.Generator) -> Floats:
    """Return a rotation ``(3, 3)``, all equally probable."""
    return np.asarray(Rotation.from_quat(rng.standard_normal(4)).as_matrix(), np.float64)


@dataclass(frozen=True)
class ToyDraw:
    """How toys are drawn.

    Attributes:
        kinds: Their kinds, all equally probable.
        width_m: Least and greatest width; a doll is 1.6 times as high.
        upright: Probability that a toy stands; otherwise it is turned in any way.
    """

    kinds: Sequence[ToyKind]
    width_m: tuple[float, float]
    upright: float = 0.5


class ToyScene:
    """A copy of a room in which toys are put.

    Args:
        room: The empty room; it is not changed.

    Attributes:
        scene: The scene with the toys.
        kinds: Index of the kind of each toy among those it was drawn from.
        centres: Position of each toy, ``(3,)`` metres.
    """

    def __init__(self, room: Scene) -> None:
        self.scene = copy.deepcopy(room)
        self.kinds: list[int] = []
        self.centres: list[Floats] = []
        self.toys: list[SceneObject] = []

    def add(
        self,
        rng: np.random.Generator,
        draw: ToyDraw,
        position: Floats,
        colour: Sequence[float] | None = None,
    ) -> None:
        """Put a toy on the floor.

        Args:
            rng: Source of its kind, size, attitude and colour.
            draw: How it is drawn.
            position: ``(2,)`` metres.
            colour: Red, green and blue in [0, 1]; None draws one.
        """
        kind = int(rng.integers(len(draw.kinds)))
        width_m = float(rng.uniform(*draw.width_m))
        upright, attitude = rng.random() < draw.upright, random_rotation(rng)
        yaw_rad, drawn = float(rng.uniform(-math.pi, math.pi)), rng.uniform(0.05, 0.95, 3)
        red, green, blue = map(float, drawn if colour is None else colour)
        name = f"toy {len(self.toys)}"
        cfg = toy(name, draw.kinds[kind], (0.0, 0.0), width_m=width_m, colour=(red, green, blue))
        geoms = prop_geoms(cfg)
        rotation = rotation_about_vertical(yaw_rad) if upright else attitude
        item = self.scene.add_object(name, [geoms])
        centre = np.array([*position, -lowest_m(geoms, rotation)])
        item.positions[0], item.rotations[0] = centre, rotation
        self.kinds.append(kind)
        self.centres.append(centre)
        self.toys.append(item)

    def finish(self) -> None:
        """Compute the poses of all primitives, after the last toy was added."""
        self.scene.update()


@dataclass(frozen=True)
class Gaze:
    """How a camera is drawn that looks at a toy.

    Attributes:
        distance_m: Least and greatest distance from the centre of the toy.
        height_m: Least and greatest height of the camera.
        aside: Greatest angle between its axis and the toy, as a fraction of half of the field of
            view, so that the toy is anywhere in the image.
        roll_deg: Greatest rotation about its axis.
    """

    distance_m: tuple[float, float]
    height_m: tuple[float, float]
    aside: float = 0.8
    roll_deg: float = 15.0

    def draw(
        self, rng: np.random.Generator, target: Floats, floor: Floor, fov_deg: float
    ) -> Pose | None:
        """Return the pose of a camera, or None if the draw is outside of the room.

        Args:
            rng: Source of all that is random.
            target: ``(3,)`` metres, the centre of the toy.
            floor: Where the camera may be.
            fov_deg: Field of view of the camera.
        """
        distance_m, height_m = rng.uniform(*self.distance_m), rng.uniform(*self.height_m)
        azimuth = rng.uniform(-math.pi, math.pi)
        aside = rng.uniform(-1.0, 1.0, 2) * self.aside * math.radians(fov_deg) / 2.0
        roll = math.radians(rng.uniform(-self.roll_deg, self.roll_deg))
        rise_m = height_m - float(target[2])
        if abs(rise_m) >= 0.95 * distance_m:
            return None
        ahead_m = math.sqrt(distance_m**2 - rise_m**2)
        way = ahead_m * np.array([math.cos(azimuth), math.sin(azimuth)])
        position = np.array([target[0] + way[0], target[1] + way[1], height_m])
        if not floor.contains(position):
            return None
        pose = look_at(position, target)
        turn = Rotation.from_euler("ZYX", [aside[0], aside[1], roll]).as_matrix()
        return Pose(pose.position, pose.rotation @ turn)


class EyePair:
    """Two parallel eyes of the settings of vision, at any pose of their middle.

    Args:
        cfg: The settings of the sense.
    """

    def __init__(self, cfg: VisionCfg) -> None:
        self.camera = cfg.camera()
        self._sides = (1.0,) if cfg.eyes is Eyes.monocular else (1.0, -1.0)
        self._filters = make_filters(cfg)

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.camera.height / (2.0 * float(self.camera.lens.tan_y))

    def render(self, scene: Scene, middle: Pose) -> Views:
        """Return the images of the open eyes, left first, before any filter.

        Args:
            scene: The scene, as of its last update.
            middle: Pose between the eyes.
        """
        left = middle.rotation[:, 1]
        poses = [
            Pose(middle.position + side * _EYE_ASIDE_M * left, middle.rotation)
            for side in self._sides
        ]
        return self.camera.render(scene, poses)

    def observe(self, views: Views) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
        """Return the observation ``(2, 3, H, W)`` of the sense: filtered, for both eyes."""
        planes = views.planes
        if self._filters:
            context = FilterContext(self.camera, views.depth, math.inf)
            rgb = np.ascontiguousarray(views.rgb)
            for apply in self._filters:
                rgb = apply(rgb, context)
            planes = rgb.transpose(0, 3, 1, 2)
        both = planes if len(planes) == 2 else planes.repeat(2, axis=0)
        return np.ascontiguousarray(both)


def pixels_of(views: Views, item: SceneObject) -> int:
    """Return the number of pixels that show an object, in the eye that shows the fewest."""
    return int((views.ids == item.id).sum(axis=(1, 2)).min())


def check_camera(camera: Camera, least_pixels: int) -> None:
    """Raise `ValueError` if an object cannot have that many pixels in an image."""
    if least_pixels > camera.width * camera.height:
        raise ValueError(
            f"dataset.least_pixels={least_pixels} is more than an image of "
            f"{camera.width}x{camera.height} has"
        )
