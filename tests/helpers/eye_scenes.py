"""Scenes and bodies of the tests of vision, and a reference ray caster."""

from dataclasses import dataclass, field

import numpy as np

from veca_marl.sim.geometry import Geom, Pose, Scene, Shape, quaternions_to_matrices
from veca_marl.sim.vision import Camera, look_at

EYE_SPACING_M = 0.04
SIMPLE = (Shape.SPHERE, Shape.BOX, Shape.CYLINDER, Shape.CAPSULE)


def random_size(shape, rng):
    count = {Shape.SPHERE: 1, Shape.BOX: 3, Shape.CYLINDER: 2, Shape.CAPSULE: 2}[shape]
    return tuple(float(s) for s in rng.uniform(0.05, 0.4, count))


def random_rotations(count, rng):
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    out = np.empty((count, 3, 3))
    quaternions_to_matrices(quaternions, out)
    return out


def clutter(rng, per_shape=6, shapes=SIMPLE, walls=True):
    """Primitives of every shape in random poses within a room."""
    scene = Scene()
    if walls:
        scene.add_object("floor", [[Geom(Shape.BOX, (3, 3, 0.1), offset=(0, 0, -0.1))]])
        scene.add_object("wall", [[Geom(Shape.BOX, (0.1, 3, 1.2), offset=(3.1, 0, 1.2))]])
    for shape in shapes:
        frames = [[Geom(shape, random_size(shape, rng))] for _ in range(per_shape)]
        item = scene.add_object(shape.name, frames)
        item.positions[:] = rng.uniform((-2, -2, 0), (2, 2, 1.2), (per_shape, 3))
        item.rotations[:] = random_rotations(per_shape, rng)
    scene.update()
    return scene


def random_pose(rng):
    eye = rng.uniform((-2.5, -2.5, 0.05), (2.5, 2.5, 1.5))
    roll = random_rotations(1, rng)[0]
    return Pose(eye, roll) if rng.random() < 0.3 else look_at(eye, rng.uniform(-1, 1, 3))


def ball_at(position, radius=0.1, colour=(1.0, 0.0, 0.0)):
    """A scene with one ball."""
    scene = Scene()
    ball = scene.add_object("ball", [[Geom(Shape.SPHERE, (radius,), colour=colour)]])
    ball.positions[0] = position
    scene.update()
    return scene


def cast(scene, camera, pose):
    """Ray casting in double precision with textbook formulas, every primitive for every pixel.

    Returns depth ``(H, W)`` and object ids ``(H, W)``.
    """
    columns = (2 * (np.arange(camera.width) + 0.5) / camera.width - 1) * np.tan(
        np.radians(camera.fov_deg) / 2
    )
    columns *= camera.width / camera.height
    rows = (1 - 2 * (np.arange(camera.height) + 0.5) / camera.height) * np.tan(
        np.radians(camera.fov_deg) / 2
    )
    x, y = np.meshgrid(columns, rows)
    ray = np.stack([np.ones_like(x), -x, y], -1) @ pose.rotation.T
    depth, ids = np.full(x.shape, camera.far_m), np.full(x.shape, -1)
    hit_by = {
        Shape.SPHERE: _sphere,
        Shape.BOX: _box,
        Shape.CYLINDER: _cylinder,
        Shape.CAPSULE: _capsule,
    }
    geoms = scene.geoms
    for g, shape in enumerate(geoms.shapes):
        local_eye = geoms.rotations[g].T @ (pose.position - geoms.positions[g])
        t = hit_by[shape](local_eye, ray @ geoms.rotations[g], geoms.sizes[g].astype(float))
        nearer = (t > camera.near_m) & (t < depth)
        depth[nearer], ids[nearer] = t[nearer], geoms.objects[g]
    return depth, ids


def _near_root(a, half_b, c):
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(half_b**2 > a * c, (-half_b - np.sqrt(half_b**2 - a * c)) / a, np.nan)


def _sphere(eye, ray, size):
    return _near_root((ray**2).sum(-1), ray @ eye, eye @ eye - size[0] ** 2)


def _slab(eye, ray, half):
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (-half - eye) / ray, (half - eye) / ray
    return np.fmin(one, two), np.fmax(one, two)


def _box(eye, ray, size):
    enter, leave = _slab(eye, ray, size)
    enter, leave = enter.max(-1), leave.min(-1)
    return np.where(enter < leave, enter, np.nan)


def _rod(eye, ray, radius):
    return _near_root(
        (ray[..., :2] ** 2).sum(-1), ray[..., :2] @ eye[:2], eye[:2] @ eye[:2] - radius**2
    )


def _cylinder(eye, ray, size):
    radius, half = size[0], size[1] / 2
    side = _rod(eye, ray, radius)
    on_side = np.abs(eye[2] + side * ray[..., 2]) <= half
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (np.array([half, -half]) - eye[2]) / ray[..., 2:]
        at_end = eye[:2] + ends[..., None] * ray[..., None, :2]
        ends = np.where((at_end**2).sum(-1) <= radius**2, ends, np.nan)
    # a ray enters a convex shape once: the first surface that it hits from outside
    return np.fmin(np.where(on_side, side, np.nan), np.fmin(ends[..., 0], ends[..., 1]))


def _capsule(eye, ray, size):
    radius, half = size[0], size[1] / 2
    side = _rod(eye, ray, radius)
    side = np.where(np.abs(eye[2] + side * ray[..., 2]) <= half, side, np.nan)
    caps = [_sphere(eye - (0, 0, z), ray, size) for z in (half, -half)]
    return np.fmin(side, np.fmin(*caps))


@dataclass
class FakeBody:
    """A head with two eyes at `position`, each turned to `target`."""

    position: np.ndarray
    target: np.ndarray
    object_id: int = 0
    focal_distance_m: float = np.inf
    own_head_frames: tuple[int, ...] = ()
    name: str = "fake"
    spec: dict = field(default_factory=dict)

    def mount(self, name):
        way = np.asarray(self.target, float) - self.position
        left = np.array([-way[1], way[0], 0.0])
        left *= EYE_SPACING_M / 2 / np.linalg.norm(left)
        eye = self.position + (left if name == "eye_left" else -left)
        return look_at(eye, self.target)


def small_camera(**numbers):
    return Camera(**({"width": 61, "height": 47, "fov_deg": 70.0} | numbers))
