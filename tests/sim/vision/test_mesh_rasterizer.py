"""The mesh rasterizer: against ray casting, among primitives, and without the own head."""

import numpy as np
import pytest
from eye_scenes import ball_at
from skins import SHIRT, add_body, pose, random_angles, random_turn

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera, look_at

CAMERA = Camera(44, 36, 60.0)


def cast_triangles(scene, camera, pose_):
    """Depth ``(H, W)`` by intersecting each ray with each triangle that faces the camera, in double
    precision (Moeller & Trumbore 1997)."""
    depth = np.full((camera.height, camera.width), camera.far_m)
    x, y = np.meshgrid(camera.lens.columns.astype(float), camera.lens.rows.astype(float))
    rays = np.stack([np.ones_like(x), -x, y], -1).reshape(-1, 3) @ pose_.rotation.T
    for corners in scene.meshes.vertices[scene.meshes.triangles]:
        a, u, v = corners[0], corners[1] - corners[0], corners[2] - corners[0]
        across = np.cross(rays, v)
        volume = across @ u
        with np.errstate(divide="ignore", invalid="ignore"):
            away = pose_.position - a
            s = across @ away / volume
            q = np.cross(away, u)
            r, t = rays @ q / volume, (v @ q) / volume
            hit = (volume > 0) & (s >= 0) & (r >= 0) & (s + r <= 1) & (t > camera.near_m)
        flat = depth.reshape(-1)
        flat[hit] = np.minimum(flat[hit], t[hit])
    return depth


@pytest.mark.parametrize("distance_m", [0.05, 0.25, 0.6, 2.0])
def test_depths_equal_those_of_ray_casting(distance_m):
    """Also with the camera among the triangles, some of which cross its plane."""
    rng = np.random.default_rng(int(100 * distance_m))
    differing = total = 0
    for _ in range(3):
        scene, eye, theirs = seen_body(rng, distance_m)
        ours = CAMERA.render(scene, [eye], hidden=geoms_of(scene)).depth[0]
        same = np.isclose(ours, theirs, rtol=1e-4)
        differing, total = differing + (~same).sum(), total + same.size
    assert differing <= 0.002 * total  # rays that graze an edge fall to either side


def seen_body(rng, distance_m):
    """A body in a random pose, an eye, and the depths that it sees: some of them of the body.

    From within a body all triangles may face away.
    """
    for _ in range(100):
        scene = Scene()
        pose(add_body(scene), random_angles(rng, 0.5), rotation=random_turn(rng))
        scene.update()
        way = rng.normal(size=3)
        eye = look_at(distance_m * way / np.linalg.norm(way), rng.normal(size=3) * 0.05)
        depths = cast_triangles(scene, CAMERA, eye)
        if (depths < CAMERA.far_m).sum() > 5:
            return scene, eye, depths
    raise AssertionError("no eye sees the body")


def geoms_of(scene):
    return np.arange(len(scene.surfaces.objects)) < len(scene.geoms.shapes)


def test_a_pixel_shows_the_body_and_its_colours():
    scene = Scene()
    scene.add_object("other", [[Geom(Shape.SPHERE, (0.1,), offset=(5.0, 5.0, 0.0))]])
    body = add_body(scene)
    scene.update()
    views = Camera(200, 200, 60.0).render(scene, [look_at(np.array([1.2, 0.0, 0.1]), np.zeros(3))])
    seen = views.rgb[0][views.ids[0] == body.id].astype(float)
    assert 0.05 < (views.ids[0] == body.id).mean() < 0.5
    assert set(np.unique(views.ids[0])) <= {-1, body.id}
    share = seen / np.maximum(seen.sum(1, keepdims=True), 1)
    for colour in (SHIRT, (0.93, 0.74, 0.62), (0.25, 0.28, 0.40), (0.30, 0.20, 0.15)):
        wanted = np.array(colour) / sum(colour)
        assert (np.abs(share - wanted).max(1) < 0.02).mean() > 0.005, colour


def test_meshes_and_primitives_occlude_each_other():
    scene = Scene()
    body = add_body(scene)
    for name, x in (("before", 0.5), ("behind", -0.5)):
        scene.add_object(name, [[Geom(Shape.SPHERE, (0.03,), offset=(x, 0.0, 0.1))]])
    scene.update()
    ids = CAMERA.render(scene, [look_at(np.array([1.0, 0.0, 0.1]), np.array([0, 0, 0.1]))]).ids[0]
    assert ids[18, 22] == scene.find("before").id
    assert (ids == body.id).any()
    assert not (ids == scene.find("behind").id).any()


def test_the_own_head_is_hidden_and_the_hands_are_not():
    skeleton = load_skeleton()
    scene = Scene()
    body = add_body(scene)
    angles = np.zeros(82)
    for side in "lr":
        angles[skeleton.joint(f"{side}_upper_arm", "flexion")] = 1.5
    pose(body, angles)
    scene.update()
    head = skeleton.bone("head")
    place = body.positions[head] + body.rotations[head] @ (0.078, 0.0225, 0.075)
    eye = Pose(place, body.rotations[head])
    hidden = scene.hidden(body.id, (skeleton.bone("neck"), head))
    views = Camera(84, 84, 100.0).render(scene, [eye], hidden)
    own = views.ids[0] == body.id
    assert 0.01 < own.mean() < 0.4
    assert not own[:30].any()  # nothing of the own face hangs in the view


def test_interpolated_normals_light_a_mesh_as_smoothly_as_a_sphere():
    """The top of the head compared with a sphere."""
    scene = Scene()
    add_body(scene)
    scene.update()
    top = np.array([0.01, 0.0, 0.313 + 0.135])
    eye = top + np.array([0.3, 0.0, 0.8])
    view = Camera(60, 60, 8.0).render(scene, [look_at(eye, top)])
    ball = Camera(60, 60, 8.0).render(
        ball_at(top - (0, 0, 0.07), 0.07, (0.35, 0.22, 0.12)),
        [look_at(eye, top)],
    )
    ours, theirs = view.rgb[0][30, 30].astype(float), ball.rgb[0][30, 30].astype(float)
    np.testing.assert_allclose(ours, theirs, rtol=0.12)
