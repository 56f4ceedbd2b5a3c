"""The camera: projection, depth, clipping planes, transparency and errors."""

import numpy as np
import pytest
from eye_scenes import ball_at, clutter, random_pose, small_camera
from refusals import naming

from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera, look_at, seen_fraction

AHEAD = Pose(np.zeros(3), np.eye(3))


def centre_of(ids, object_id):
    rows, columns = np.nonzero(ids == object_id)
    return columns.mean() + 0.5, rows.mean() + 0.5


@pytest.mark.parametrize(
    ("position", "right", "below"),
    [
        ((2, 0.5, 0), False, None),
        ((2, -0.5, 0), True, None),
        ((2, 0, 0.5), None, False),
        ((2, 0, -0.5), None, True),
    ],
)
def test_left_is_left_and_up_is_up(position, right, below):
    ids = Camera().render(ball_at(position), [AHEAD]).ids[0]
    column, row = centre_of(ids, 0)
    assert column == pytest.approx(42, abs=0.3) if right is None else (column > 50) == right
    assert row == pytest.approx(42, abs=0.3) if below is None else (row > 50) == below


def test_rendered_positions_equal_projected_ones():
    rng = np.random.default_rng(0)
    camera = Camera(640, 480, fov_deg=70.0)
    for _ in range(40):
        pose = random_pose(rng)
        point = pose.position + pose.rotation @ (3.0, *rng.uniform(-1, 1, 2))
        ids = camera.render(ball_at(point, radius=0.03), [pose]).ids[0]
        ((column, row, depth),) = camera.project(pose, point[None])
        assert depth == pytest.approx(3.0)
        assert centre_of(ids, 0) == pytest.approx((column, row), abs=0.6)


def test_depth_is_measured_along_the_optical_axis():
    scene = Scene()
    scene.add_object("wall", [[Geom(Shape.BOX, (0.5, 50, 50), offset=(4.5, 0, 0))]])
    scene.update()
    views = small_camera().render(scene, [AHEAD])
    np.testing.assert_allclose(views.depth, 4.0, rtol=1e-5)


def test_depth_inverts_the_projection():
    """Points reconstructed from pixels and depths lie on the ball of their segmentation id."""
    camera, scene = Camera(), ball_at((2, 0.3, 0.1), radius=0.4)
    views = camera.render(scene, [AHEAD])
    rows, columns = np.nonzero(views.ids[0] == 0)
    t = views.depth[0][rows, columns]
    points = np.stack([t, -t * camera.lens.columns[columns], t * camera.lens.rows[rows]], 1)
    np.testing.assert_allclose(np.linalg.norm(points - (2, 0.3, 0.1), axis=1), 0.4, atol=1e-4)


def test_pixels_without_a_surface_show_the_sky():
    camera = Camera(far_m=30.0)
    views = camera.render(ball_at((-2, 0, 0)), [AHEAD])
    assert (views.ids == -1).all()
    assert (views.depth == 30.0).all()
    assert len(np.unique(views.rgb[0, 0], axis=0)) == 1
    assert views.rgb[0, 0].mean() > views.rgb[0, -1].mean()


def test_near_and_far_planes_clip():
    camera = Camera(near_m=1.0, far_m=3.0)
    for distance, seen in [(0.5, False), (2.0, True), (3.5, False)]:
        ids = camera.render(ball_at((distance, 0, 0)), [AHEAD]).ids
        assert (ids == 0).any() == seen


def test_views_do_not_depend_on_each_other():
    rng = np.random.default_rng(3)
    scene, camera = clutter(rng), small_camera()
    poses = [random_pose(rng) for _ in range(3)]
    together = camera.render(scene, poses)
    for v, pose in enumerate(poses):
        alone = camera.render(scene, [pose])
        for name in ("rgb", "depth", "ids"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[v])


def test_a_higher_resolution_shows_the_same_scene():
    """An image of three times the size contains the pixels of the small one."""
    rng = np.random.default_rng(4)
    scene, pose = clutter(rng), random_pose(rng)
    small = Camera(50, 40).render(scene, [pose])
    large = Camera(150, 120).render(scene, [pose])
    np.testing.assert_array_equal(small.ids[0], large.ids[0, 1::3, 1::3])
    np.testing.assert_allclose(small.depth[0], large.depth[0, 1::3, 1::3], rtol=1e-4)


def test_hidden_primitives_are_not_seen():
    scene = ball_at((2, 0, 0))
    hidden = scene.hidden(0, (0,))
    assert (Camera().render(scene, [AHEAD], hidden).ids == -1).all()
    with pytest.raises(ValueError, match=naming("hidden", "(5,)")):
        Camera().render(scene, [AHEAD], np.zeros(5, np.bool_))


def lit_ball(direction):
    """Mean brightness of a white ball seen from one side."""
    scene = ball_at((0, 0, 0), colour=(1, 1, 1))
    views = Camera(fov_deg=20).render(scene, [look_at(np.multiply(direction, 2.0), np.zeros(3))])
    return views.rgb[views.ids == 0].mean()


def test_light_comes_from_above():
    above, below = lit_ball((0.01, 0, 1)), lit_ball((0.01, 0, -1))
    assert above > 1.4 * below
    assert below > 40  # what is in the shade can still be seen


def test_checker_tiles_have_the_configured_edge():
    scene = Scene()
    floor = Geom(Shape.BOX, (9, 9, 0.5), colour=(1, 1, 1), offset=(0, 0, -0.5), checker_m=0.5)
    scene.add_object("floor", [[floor]])
    scene.update()
    down = Pose(np.array([0.1, 0.1, 5.0]), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]]))
    row = Camera(400, 400).render(scene, [down]).rgb[0, 200, :, 0].astype(int)
    edges = np.flatnonzero(np.diff(row))
    metres_per_pixel = 2 * 5.0 * np.tan(np.radians(30)) / 400
    np.testing.assert_allclose(np.diff(edges) * metres_per_pixel, 0.5, atol=0.016)


@pytest.fixture
def window():
    """A red ball behind a blue pane, and a second ball behind a wall."""
    scene = ball_at((3, 0, 0))
    glass = Geom(
        Shape.BOX, (0.01, 1, 1), colour=(0.0, 0.0, 1.0), offset=(1.5, 0, 0), transparent=True
    )
    scene.add_object("pane", [[glass]])
    scene.update()
    return scene


def test_transparent_primitives_tint_and_do_not_occlude(window):
    views = Camera().render(window, [AHEAD])
    assert views.ids[0, 42, 42] == 0
    assert views.glass_ids[0, 0, 42, 42] == 1
    assert views.depth[0, 42, 42] == pytest.approx(2.9, abs=5e-3)
    bare = Camera().render(window, [AHEAD], window.hidden(1, (0,)))
    red, _, blue = (views.rgb[0, 42, 42].astype(int) - bare.rgb[0, 42, 42]).tolist()
    assert red < 0 < blue
    assert seen_fraction(views, 0) == seen_fraction(bare, 0) > 0
    assert seen_fraction(views, 1) > 0.5
    assert bare.glass_ids.shape == (0, 1, 84, 84)


def test_transparent_primitives_behind_a_wall_are_hidden(window):
    window.add_object("wall", [[Geom(Shape.BOX, (0.1, 5, 5), offset=(1, 0, 0))]])
    window.update()
    views = Camera().render(window, [AHEAD])
    assert seen_fraction(views, 0) == seen_fraction(views, 1) == 0.0


def test_look_at_has_a_level_horizon():
    pose = look_at(np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, 1.0]))
    np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    assert pose.rotation[2, 1] == 0.0
    assert pose.rotation[2, 2] > 0.0
    with pytest.raises(ValueError, match=naming("camera", "[0. 0. 0.]", "[0. 0. 1.]")):
        look_at(np.zeros(3), np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ({"width": 0}, "0x84"),
        ({"width": 10**9}, "1000000000x84"),
        ({"width": 84.5}, "84.5x84"),
        ({"fov_deg": 180.0}, "180.0"),
        ({"fov_deg": np.nan}, "fov_deg nan"),
        ({"near_m": 0.0}, "near_m 0.0"),
        ({"near_m": 2.0, "far_m": 1.0}, "near_m 2.0"),
    ],
)
def test_invalid_cameras_are_refused(numbers, named):
    with pytest.raises(ValueError, match=named):
        Camera(**numbers)
