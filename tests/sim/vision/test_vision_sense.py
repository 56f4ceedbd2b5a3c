"""The sense of vision: specs, binocular geometry, visibility and determinism."""

import hashlib
import math
import os
import pathlib
import subprocess
import sys
from collections import namedtuple

import numpy as np
import pytest
from eye_scenes import EYE_SPACING_M, FakeBody, ball_at, clutter
from paths import HELPERS, ROOT
from refusals import naming
from stand_in_worlds import SceneWorld

from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.sense import check_spec
from veca_marl.sim.vision import Camera, Eyes, VisionCfg, VisionSense, is_visible

Target = namedtuple("Target", "object_id")
EVERYTHING = {"depth": True, "segmentation": True}


def eyes(cfg, body, scene):
    return VisionSense(cfg, body, SceneWorld(scene))


def body_before(target=(2.0, 0.0, 0.0), **numbers):
    return FakeBody(np.zeros(3), np.array(target), **numbers)


@pytest.mark.parametrize(
    "cfg",
    [
        VisionCfg(**EVERYTHING),
        VisionCfg(**EVERYTHING, width=40, height=30),
        VisionCfg(**EVERYTHING, eyes=Eyes.monocular),
        VisionCfg(**EVERYTHING, grey=True, blur_deg=1.0, infant_age_months=1.0, defocus=True),
        VisionCfg(),
    ],
)
def test_observations_match_their_specs(cfg):
    rng = np.random.default_rng(0)
    sense = eyes(cfg, body_before(focal_distance_m=0.5), clutter(rng))
    read = sense.read()
    assert read.keys() == sense.specs.keys()
    for name, spec in sense.specs.items():
        check_spec(name, read[name], spec)
        assert read[name].min() >= spec.low
        assert read[name].max() <= spec.high
        assert read[name].flags.c_contiguous
    assert ("depth" in read) == cfg.depth


def test_is_visible_uses_the_camera_of_the_default_sense(monkeypatch):
    scene, body, used = ball_at((2.0, 0.0, 0.0)), body_before(), []
    render = Camera.render
    monkeypatch.setattr(Camera, "render", lambda *args: used.append(args[0]) or render(*args))
    assert is_visible(scene, body, Target(0))
    assert used == [eyes(VisionCfg(), body, scene).camera]
    assert VisionCfg(width=100, fov_deg=30.0).camera() == Camera(100, 84, 30.0)


def test_what_only_one_eye_sees_is_visible():
    """A ball behind a board that hides it from the left eye, not from the right one."""
    scene, body = ball_at((2.0, 0.0, 0.0), 0.05), body_before()
    board = Geom(Shape.BOX, (0.005, 0.01, 0.05), offset=(0.1, EYE_SPACING_M / 2, 0.0))
    scene.add_object("board", [[board]])
    scene.update()
    assert not is_visible(scene, body, Target(0), ["eye_left"])
    assert is_visible(scene, body, Target(0), ["eye_right"])
    assert is_visible(scene, body, Target(0))
    assert eyes(VisionCfg(), body, scene).eyes.is_visible(0)
    assert not eyes(VisionCfg(eyes=Eyes.monocular), body, scene).eyes.is_visible(0)
    with pytest.raises(ValueError, match=naming("eyes", "[]", "eye_left")):
        is_visible(scene, body, Target(0), [])


def test_visibility_depends_on_the_field_of_view():
    """A ball 40 degrees to the left is outside of the default image and inside a wide one."""
    scene, body = ball_at((2.0, 2.0 * math.tan(math.radians(40.0)), 0.0)), body_before()
    for fov_deg, visible in ((60.0, False), (100.0, True)):
        assert eyes(VisionCfg(fov_deg=fov_deg), body, scene).eyes.is_visible(0) is visible


def test_quality_does_not_change_the_specs():
    cfgs = [
        VisionCfg(),
        VisionCfg(eyes=Eyes.monocular),
        VisionCfg(grey=True),
        VisionCfg(blur_deg=2.0, defocus=True, infant_age_months=3.0),
    ]
    scene = ball_at((2, 0, 0))
    specs = [eyes(cfg, body_before(), scene).specs for cfg in cfgs]
    assert all(one == specs[0] for one in specs)


@pytest.mark.parametrize("target", [(0.5, 0.0, 0.0), (1.0, 0.4, -0.2), (3.0, -1.0, 0.5)])
def test_vergence_centres_a_point_in_both_eyes(target):
    sense = eyes(VisionCfg(segmentation=True), body_before(target), ball_at(target, 0.05))
    for ids in sense.read()["segmentation"]:
        rows, columns = np.nonzero(ids == 0)
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((42, 42), abs=0.51)


def test_disparity_is_the_difference_of_vergence_angles():
    """Eyes converged at 1 m, a ball at 0.6 m."""
    body, scene = body_before((1.0, 0.0, 0.0)), ball_at((0.6, 0, 0), 0.03)
    sense = eyes(VisionCfg(width=600, height=600, segmentation=True), body, scene)
    left, right = (np.nonzero(ids == 0)[1].mean() for ids in sense.read()["segmentation"])
    half = EYE_SPACING_M / 2
    apart_rad = 2 * (math.atan(half / 0.6) - math.atan(half / 1.0))
    apart_pixels = math.degrees(apart_rad) / sense.camera.degrees_per_pixel
    assert left - right == pytest.approx(
        apart_pixels, rel=0.03
    )  # the left eye sees it to the right


def test_monocular_repeats_the_left_image():
    scene = ball_at((0.5, 0.0, 0.0))
    both = eyes(VisionCfg(**EVERYTHING), body_before(), scene).read()
    one = eyes(VisionCfg(**EVERYTHING, eyes=Eyes.monocular), body_before(), scene).read()
    for name, images in one.items():
        np.testing.assert_array_equal(images[0], images[1])
        np.testing.assert_array_equal(images[0], both[name][0])
    assert (both["vision"][0] != both["vision"][1]).any()


def test_channels_are_red_green_blue():
    sense = eyes(VisionCfg(), body_before(), ball_at((2, 0, 0), 0.3, (1.0, 0.0, 0.0)))
    red, green, blue = sense.read()["vision"][0, :, 42, 42]
    assert red > 100
    assert green == blue == 0


def test_defocus_follows_the_bodys_focal_distance():
    rng = np.random.default_rng(2)
    scene, body = clutter(rng), body_before(focal_distance_m=math.inf)
    sharp = eyes(VisionCfg(width=200, height=200), body, scene).read()["vision"]
    sense = eyes(VisionCfg(width=200, height=200, defocus=True), body, scene)
    far = sense.read()["vision"]
    body.focal_distance_m = 0.1
    scene.update()
    near = sense.read()["vision"]
    assert (near != far).any()
    assert np.abs(near - sharp.astype(int)).mean() > np.abs(far - sharp.astype(int)).mean()


@pytest.fixture
def room():
    """One ball in sight, one behind a wall, one behind glass, one behind the back."""
    scene = Scene()
    ball = Geom(Shape.SPHERE, (0.1,), colour=(1, 0, 0))
    for name, position in {
        "plain": (2, 0.4, 0),
        "walled": (3, -0.6, 0),
        "glazed": (2, 0, 0),
        "back": (-2, 0, 0),
    }.items():
        scene.add_object(name, [[ball]]).positions[0] = position
    scene.add_object("wall", [[Geom(Shape.BOX, (0.05, 0.4, 0.5), offset=(2, -0.6, 0))]])
    pane = Geom(Shape.BOX, (0.01, 0.2, 0.2), offset=(1.5, 0, 0), transparent=True)
    scene.add_object("pane", [[pane]])
    scene.update()
    return scene


def test_is_visible_through_glass_and_not_through_walls(room):
    sense = eyes(VisionCfg(), body_before(), room)
    seen = {item.name for item in room.objects if sense.eyes.is_visible(item.id)}
    assert seen == {"plain", "glazed", "wall", "pane"}


def test_is_visible_after_the_wall_has_moved(room):
    sense, walled = eyes(VisionCfg(), body_before(), room), room.find("walled")
    assert not sense.eyes.is_visible(walled.id)
    room.find("wall").positions[0] = (0, 0, 10)
    room.update()
    assert sense.eyes.is_visible(walled.id)


def test_is_visible_after_the_eyes_have_turned(room):
    body = body_before()
    sense, back = eyes(VisionCfg(), body, room), room.find("back")
    assert not sense.eyes.is_visible(back.id)
    body.target = np.array([-2.0, 0.1, 0.0])
    assert sense.eyes.is_visible(back.id)


def test_seen_fraction_is_the_fraction_of_pixels(room):
    cfg = VisionCfg(segmentation=True)
    sense, plain = eyes(cfg, body_before(), room), room.find("plain")
    expected = np.mean(sense.read()["segmentation"] == plain.id)
    assert sense.eyes.seen_fraction(plain.id) == pytest.approx(expected)
    assert 0.001 < expected < 0.1


def test_the_own_head_is_hidden_and_another_head_is_not():
    scene = Scene()
    head, hand = Geom(Shape.SPHERE, (0.015,)), Geom(Shape.SPHERE, (0.02,), offset=(0.5, 0, 0))
    scene.add_object("other", [[head]]).positions[0] = (1.0, 0.2, 0)
    me = scene.add_object("me", [[head], [hand]])
    me.positions[0] = (0.05, 0, 0)
    scene.update()
    body = body_before(object_id=me.id, own_head_frames=(0,))
    sense = eyes(VisionCfg(segmentation=True, depth=True), body, scene)
    read = sense.read()
    mine = read["segmentation"] == me.id
    assert mine.any()
    assert read["depth"][mine].min() > 0.4
    assert (read["segmentation"] == 0).any()
    scene.add_object("late", [[Geom(Shape.SPHERE, (0.1,))]]).positions[0] = (1.5, -0.3, 0)
    scene.update()
    assert sense.eyes.is_visible(2)
    assert sense.read()["depth"][mine].min() > 0.4


def digest_of_an_observation():
    """Hash of an observation with all filters in a cluttered room."""
    cfg = VisionCfg(**EVERYTHING, blur_deg=0.5, infant_age_months=2.0, defocus=True)
    scene = clutter(np.random.default_rng(6))
    read = eyes(cfg, body_before(focal_distance_m=0.5), scene).read()
    return hashlib.sha256(b"".join(read[name].tobytes() for name in sorted(read))).hexdigest()


def digest_elsewhere(**environment):
    """The same hash from another process."""
    code = "import test_vision_sense; print(test_vision_sense.digest_of_an_observation())"
    paths = [str(HELPERS), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    other = subprocess.run(
        [sys.executable, "-c", code],
        cwd=pathlib.Path(__file__).parent,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return other.stdout.split()[-1]


def test_another_process_computes_the_same_bytes():
    assert digest_elsewhere() == digest_of_an_observation()


@pytest.mark.slow
def test_freshly_compiled_kernels_compute_the_same_bytes(tmp_path):
    """With floating-point reordering, compiled and cached kernels would differ in the last bit."""
    first = digest_of_an_observation()
    assert digest_elsewhere(NUMBA_CACHE_DIR=str(tmp_path)) == first
    assert digest_elsewhere(NUMBA_CACHE_DIR=str(tmp_path)) == first


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"width": 0}, ("0x84",)),
        ({"width": 10**9}, ("1000000000x84",)),
        ({"height": 84.5}, ("84x84.5",)),
        ({"fov_deg": 200.0}, ("fov_deg", "200.0")),
        ({"eyes": "three"}, ("eyes", "'three'", "binocular", "monocular")),
        ({"blur_deg": -1.0}, ("blur_deg", "-1.0")),
        ({"pupil_mm": 0.0}, ("pupil_mm", "0.0")),
        ({"pupil_mm": 25.0}, ("pupil_mm", "25.0", "20")),
        ({"accommodation_dpt": -1.0}, ("accommodation_dpt", "-1.0", "100")),
        ({"accommodation_dpt": 200.0}, ("accommodation_dpt", "200.0")),
        ({"infant_age_months": -2.0}, ("age_months", "-2.0")),
    ],
)
def test_invalid_settings_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        VisionCfg(**numbers)
