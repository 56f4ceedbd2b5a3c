"""The cost of rendering relative to PyBullet's software renderer in the same run."""

import time

import numpy as np
from eye_scenes import random_rotations

from veca_marl.fidelity.vision.tiny_renderer import TinyRenderer
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.vision import Camera, look_at

BONES = 47


def crowded_room(rng):
    """A room of four walls with 20 props and two bodies of 47 capsules."""
    scene = Scene()
    scene.add_object("floor", [[Geom(Shape.BOX, (3, 3, 0.1), offset=(0, 0, -0.1), checker_m=0.5)]])
    for x, y in [(1, 0), (-1, 0), (0, 1), (0, -1)]:
        size = (0.1, 3, 1.2) if x else (3, 0.1, 1.2)
        scene.add_object(f"wall {x} {y}", [[Geom(Shape.BOX, size, offset=(3.1 * x, 3.1 * y, 1.2))]])
    for k in range(20):
        r = rng.uniform(0.08, 0.2)
        size = [(r,), (r, r, r), (r, 2 * r), (0.6 * r, 2 * r)][k % 4]
        prop = scene.add_object(f"prop {k}", [[Geom(Shape(k % 4), size)]])
        prop.positions[0] = (*rng.uniform(-2, 2, 2), 0.3)
    for k, x in enumerate((0.9, -0.9)):
        body = scene.add_object(f"body {k}", [[Geom(Shape.CAPSULE, (0.02, 0.06))]] * BONES)
        body.positions[:] = (x, 0, 0.35) + rng.normal(size=(BONES, 3)) * (0.08, 0.12, 0.2)
        body.rotations[:] = random_rotations(BONES, rng)
    scene.update()
    return scene


def processor_s(render, repeats):
    """Processor time of one call.

    Wall time on a busy machine would favour the shorter call, which fits between interruptions.
    """
    render()
    start = time.process_time()
    for _ in range(repeats):
        render()
    return (time.process_time() - start) / repeats


def test_eight_times_as_fast_as_tiny_renderer():
    scene = crowded_room(np.random.default_rng(0))
    camera = Camera(84, 84, 60.0, near_m=0.02, far_m=12.0)
    ours, tinys = [], []
    with TinyRenderer(scene) as tiny:
        for angle in (0.3, 1.8, 3.3, 4.8):
            eye = np.array([2 * np.cos(angle), 2 * np.sin(angle), 0.6])
            pose = look_at(eye, np.array([0.0, 0.0, 0.3]))
            ours.append(processor_s(lambda pose=pose: camera.render(scene, [pose]), 60))
            tinys.append(processor_s(lambda pose=pose: tiny.segment(camera, pose), 12))
    ratio = np.mean(tinys) / np.mean(ours)
    assert ratio >= 8.0, f"{1e3 * np.mean(ours):.2f} ms, {1e3 * np.mean(tinys):.2f} ms a view"
