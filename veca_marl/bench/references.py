"""Costs of single senses, beside references that are measured in the same run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.bench.body_views import BodyViews, measure_body_views
from veca_marl.bench.stopwatch import thread_ms
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.geometry import (
    Bools,
    Geom,
    Pose,
    Scene,
    Shape,
    deform_meshes,
    matrix_to_quaternion,
)
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, World, shape_arguments
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.sound import SoundCfg, SoundKind, make_sound
from veca_marl.sim.touch import TouchCfg, TouchSense
from veca_marl.sim.vision import Camera

CONTACTS = (0, 3, 20)
DISTANT = 300
_ARMS_OUT = Posture(0.0, {"upper_arm.abduction": 30.0})  # no self-contact
_RADIUS_M = 0.03


@dataclass
class SkinCosts:
    """Cost of the skin of one body.

    Attributes:
        skinning_ms: Milliseconds of computing the vertices from the poses of the bones.
        touch_ms: Milliseconds of one reading of all taxels, by the number of contacts.
        distant_ms: That with 3 contacts, beside `DISTANT` primitives that touch nothing.
    """

    skinning_ms: float
    touch_ms: dict[int, float]
    distant_ms: float


def measure_skin(playground: PlaygroundCfg, repeats: int) -> SkinCosts:
    """Measure a `full` body in the air with small balls on its skin."""
    readings = {contacts: _touch_ms(playground, contacts, repeats) for contacts in CONTACTS}
    distant_ms = _touch_ms(playground, 3, repeats, distant=DISTANT)
    return SkinCosts(_skinning_ms(playground, repeats), readings, distant_ms)


def touched_child(
    playground: PlaygroundCfg, contacts: int, distant: int = 0
) -> tuple[World, TouchSense]:
    """Return a world with a body in the air and `contacts` balls on its skin, and its touch.

    `distant` further balls are 5 m away.
    """
    world = World(playground)
    cfgs = [PropCfg(f"ball_{i}", PropShape.sphere, [_RADIUS_M]) for i in range(contacts)]
    balls = [world.add_prop(cfg) for cfg in cfgs]
    far = Geom(Shape.SPHERE, (_RADIUS_M,), offset=(5.0, 0.0, 1.0))
    world.scene.add_object("distant", [[far] * distant])
    child = Humanoid("child", HumanoidCfg(), world)
    child.place((0.0, 0.0, 1.0), posture=_ARMS_OUT)
    world.scene.update()
    sense = TouchSense(TouchCfg(), child, world)
    vertices = world.scene.meshes.vertices
    for ball, row in zip(balls, np.linspace(0, len(vertices) - 1, contacts), strict=True):
        ball.place(vertices[int(row)])
    world.scene.update()
    return world, sense


def _touch_ms(playground: PlaygroundCfg, contacts: int, repeats: int, distant: int = 0) -> float:
    world, sense = touched_child(playground, contacts, distant)
    sense.compute()
    cost = median(thread_ms(sense.compute) for _ in range(repeats))
    world.close()
    return cost


def _skinning_ms(playground: PlaygroundCfg, repeats: int) -> float:
    world, _ = touched_child(playground, 0)
    scene = world.scene

    def follow() -> None:
        deform_meshes(scene.meshes, scene.positions, scene.rotations)

    follow()
    cost = median(thread_ms(follow) for _ in range(repeats))
    world.close()
    return cost


N_LOOSE_PROPS = 20
VIEWS = 8


@dataclass
class EyeCost:
    """Cost of one eye view, and that of PyBullet's TinyRenderer on the same scene.

    Attributes:
        primitives: Number of primitives in the scene.
        ours_ms: Processor time of one 84x84 view with colours, depth and segmentation.
        tiny_ms: Processor time of the same view by TinyRenderer without shadows.
        speed_ratio: Median of `tiny_ms / ours_ms` of measurements made in turns.
    """

    primitives: int
    ours_ms: float
    tiny_ms: float
    speed_ratio: float


@dataclass
class References:
    """Costs of single parts.

    Attributes:
        eye: One eye view beside TinyRenderer.
        ears_ms: Milliseconds per step of one listener and one source.
        skin: The skin of one body.
        body: Views of one body.
    """

    eye: EyeCost
    ears_ms: float
    skin: SkinCosts
    body: BodyViews


def measure_references(playground: PlaygroundCfg, steps: int, repeats: int) -> References:
    """Measure an eye, ears, skin and views of it in a playground, one after the other."""
    return References(
        measure_eye(playground, repeats),
        measure_ears(playground, steps),
        measure_skin(playground, steps),
        measure_body_views(playground, steps),
    )


def measure_eye(playground: PlaygroundCfg, repeats: int) -> EyeCost:
    """Render `busy_room` from the left eye of a walker in `VIEWS` directions."""
    world, watcher = busy_room(playground)
    hidden = world.scene.hidden(watcher.object_id, watcher.own_head_frames)
    eye, camera = watcher.mount("eye_left"), Camera()
    poses = [_turned(eye, 2.0 * math.pi * view / VIEWS) for view in range(VIEWS)]
    client, bodies = as_visual_shapes(world.scene, hidden)
    costs = []
    for _ in range(repeats + 1):
        ours = thread_ms(lambda: camera.render(world.scene, poses, hidden))
        tiny = thread_ms(lambda: [tiny_view(client, camera, pose) for pose in poses])
        costs.append((ours / VIEWS, tiny / VIEWS))
    client.close()
    world.close()
    ours_ms, tiny_ms = zip(*costs[1:], strict=True)  # the first compiles and fills caches
    ratio = median(tiny / ours for ours, tiny in costs[1:])
    return EyeCost(len(bodies), median(ours_ms), median(tiny_ms), ratio)


class ReferenceView:
    """One TinyRenderer view of 84 x 84 pixels of `busy_room` in a fixed playground.

    The cost of a step divided by that of such a view can be compared between machines.

    Args:
        playground: The playground, the same for all measurements.
    """

    def __init__(self, playground: PlaygroundCfg) -> None:
        world, watcher = busy_room(playground)
        hidden = world.scene.hidden(watcher.object_id, watcher.own_head_frames)
        eye, self._camera = watcher.mount("eye_left"), Camera()
        self._poses = [_turned(eye, 2.0 * math.pi * view / VIEWS) for view in range(VIEWS)]
        self._client, _ = as_visual_shapes(world.scene, hidden)
        world.close()

    def run_ms(self) -> float:
        """Return the milliseconds of processor time of one view, the mean over `VIEWS`."""
        return thread_ms(self._render) / VIEWS

    def _render(self) -> None:
        for pose in self._poses:
            tiny_view(self._client, self._camera, pose)

    def close(self) -> None:
        """Disconnect from PyBullet."""
        self._client.close()


def busy_room(playground: PlaygroundCfg) -> tuple[World, Walker]:
    """Return a world with `N_LOOSE_PROPS` props and 2 walkers, and the walker that observes."""
    world = World(playground)
    props = [world.add_prop(cfg) for cfg in _loose_props()]
    watcher, other = (Walker(name, WalkerCfg(), world, i) for i, name in enumerate("ab"))
    rng = np.random.default_rng(0)
    for prop in props:
        place = playground.rooms[0].sample_floor(rng, margin_m=0.8)
        prop.place(place + np.array([0.0, 0.0, 0.15]))
    watcher.place((-1.0, 0.0, 0.0))
    other.place((1.0, 0.6, 0.0), yaw_rad=math.pi)
    world.scene.update()
    return world, watcher


def measure_ears(playground: PlaygroundCfg, steps: int) -> float:
    """Return milliseconds per step of one listener and one source, both moving, with HRTF.

    Emission, propagation in the room, the head response and the observed spectrum are included.
    """
    world = World(playground)
    buzz = SoundCfg(kind=SoundKind.buzz, level=0.1)
    source = world.sound.add_source("buzz", make_sound(buzz))
    walker = Walker("listener", WalkerCfg(), world)
    ears = AudioSense(AudioCfg(), walker, world)
    world.sound.reset(np.random.default_rng(0))

    def hear() -> None:
        world.sound.advance()
        ears.compute()

    costs = []
    for step in range(steps):
        angle = 0.05 * step
        source.position = (2.0 * math.cos(angle), 2.0 * math.sin(angle), 0.15)
        walker.place((0.0, 0.0, 0.0), yaw_rad=-0.5 * angle)
        costs.append(thread_ms(hear))
    world.close()
    return median(costs)


def _loose_props() -> list[PropCfg]:
    looks = [
        (PropShape.sphere, [0.12]),
        (PropShape.box, [0.2, 0.25, 0.3]),
        (PropShape.cylinder, [0.1, 0.3]),
        (PropShape.capsule, [0.08, 0.2]),
    ]
    return [
        PropCfg(f"loose_{i}", *looks[i % len(looks)], mass_kg=0.5) for i in range(N_LOOSE_PROPS)
    ]


def _turned(pose: Pose, yaw_rad: float) -> Pose:
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return pose._replace(rotation=about_z @ pose.rotation)


def as_visual_shapes(scene: Scene, hidden: Bools) -> tuple[BulletClient, list[int]]:
    """Show a PyBullet client the surfaces of a scene that are not hidden.

    Returns:
        The client, and the id of the scene's object for each of the client's bodies in turn.
    """
    client = BulletClient()
    geoms, objects = scene.geoms, []
    for g in np.flatnonzero(~hidden[: len(geoms.shapes)] & geoms.visible):
        shape = _visual_shape(client, Shape(geoms.shapes[g]), geoms.sizes[g], geoms.colours[g])
        client.createMultiBody(
            0.0,
            -1,
            shape,
            basePosition=geoms.positions[g].tolist(),
            baseOrientation=matrix_to_quaternion(geoms.rotations[g]).tolist(),
        )
        objects.append(int(geoms.objects[g]))
    for item in scene.objects:
        triangles = np.arange(len(geoms.shapes), len(hidden))[item.triangles]
        corners = scene.meshes.triangles[item.triangles][~hidden[triangles]]
        if len(corners):
            mesh = _visual_mesh(client, scene, corners)
            client.createMultiBody(0.0, -1, mesh)
            objects.append(item.id)
    return client, objects


def _visual_mesh(client: BulletClient, scene: Scene, triangles: NDArray[np.int64]) -> int:
    """Give PyBullet some triangles of a scene, where they are now."""
    corners = triangles.ravel()
    made = client.createVisualShape(
        pybullet.GEOM_MESH,
        vertices=scene.meshes.vertices[corners].tolist(),
        normals=scene.meshes.normals[corners].tolist(),
        indices=list(range(len(corners))),
    )
    return int(made)


def _visual_shape(
    client: BulletClient, shape: Shape, size: Sequence[float], colour: Sequence[float]
) -> int:
    rgba = [*(float(value) for value in colour), 1.0]
    made = client.createVisualShape(**shape_arguments(shape, size), rgbaColor=rgba)
    return int(made)


def tiny_view(
    client: BulletClient, camera: Camera, pose: Pose
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return TinyRenderer's picture ``(H, W, 4)`` and segmentation ``(H, W)``, -1 for the sky."""
    lens = pybullet.computeProjectionMatrixFOV(
        camera.fov_deg, camera.width / camera.height, camera.near_m, camera.far_m
    )
    forward, up = pose.rotation[:, 0], pose.rotation[:, 2]
    view = pybullet.computeViewMatrix(pose.position, pose.position + forward, up)
    _, _, rgba, _, segmentation = client.getCameraImage(
        camera.width, camera.height, view, lens, shadow=0, renderer=pybullet.ER_TINY_RENDERER
    )
    return rgba, segmentation
