"""The eyes: the point that they look at, their range, and the rows of their images."""

import math

import numpy as np
import pytest
from refusals import naming
from walking import empty_world, walker_in


def test_both_eyes_look_at_the_point():
    world = empty_world()
    walker = walker_in(world)
    head = walker.mount("head").rotation
    for point in ((0.3, 0.0, 0.7), (1.0, 0.4, 0.2), (5.0, -2.0, 1.0)):
        walker.look_toward_point(point)
        for eye in ("eye_left", "eye_right"):
            pose = walker.mount(eye)
            line = np.array(point) - pose.position
            np.testing.assert_allclose(pose.rotation[:, 0], line / np.linalg.norm(line), atol=1e-9)
            np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-12)
            assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    np.testing.assert_array_equal(walker.mount("head").rotation, head)
    np.testing.assert_array_equal(walker.mount("ear_left").rotation, head)


def test_eyes_converge_on_near_points():
    walker = walker_in(empty_world())

    def convergence_deg(distance_m):
        centre = (walker.mount("eye_left").position + walker.mount("eye_right").position) / 2.0
        walker.look_toward_point(centre + distance_m * walker.mount("head").rotation[:, 0])
        left, right = (walker.mount(eye).rotation[:, 0] for eye in ("eye_left", "eye_right"))
        return math.degrees(math.acos(min(left @ right, 1.0)))

    spacing = np.linalg.norm(walker.mount("eye_left").position - walker.mount("eye_right").position)
    for distance_m in (0.2, 1.0):
        expected = 2.0 * math.degrees(math.atan(spacing / 2.0 / distance_m))
        assert convergence_deg(distance_m) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("below_m", [-0.25, 0.0, 0.2])
@pytest.mark.parametrize("aside_m", [-0.1, 0.0, 0.25])
def test_images_of_a_fixated_point_are_not_rolled_against_each_other(aside_m, below_m):
    """What lies in the plane of both lines of sight is in the same row of both images.

    With yaw before pitch the vertical axes of both images differ, the more the nearer the point.
    """
    walker = walker_in(empty_world(), head_pitch_deg=10.0)
    left, right = (walker.mount(eye).position for eye in ("eye_left", "eye_right"))
    head = walker.mount("head").rotation
    point = (left + right) / 2.0 + head @ np.array([0.25, aside_m, -below_m])
    walker.look_toward_point(point)
    up = [walker.mount(eye).rotation[:, 2] for eye in ("eye_left", "eye_right")]
    np.testing.assert_allclose(up[0], up[1], atol=1e-12)
    normal = np.cross(point - left, point - right)
    assert abs(up[0] @ normal) == pytest.approx(np.linalg.norm(normal), rel=1e-9)


def test_eyes_keep_looking_at_the_point_until_released():
    world = empty_world()
    walker = walker_in(world)
    walker.look_toward_point((3.0, 1.0, 0.5))
    walker.walk(0.5, 0.1)
    for _ in range(25):
        world.step()
        pose = walker.mount("eye_left")
        line = np.array([3.0, 1.0, 0.5]) - pose.position
        np.testing.assert_allclose(pose.rotation[:, 0], line / np.linalg.norm(line), atol=1e-9)
    walker.release_look()
    np.testing.assert_array_equal(walker.mount("eye_left").rotation, walker.mount("head").rotation)


def test_eye_rotations_are_clipped_to_their_range():
    walker = walker_in(empty_world(), head_pitch_deg=0.0, eye_range_deg=40.0)
    walker.look_toward_point((-5.0, 0.1, 0.7))
    ahead = walker.mount("head").rotation[:, 0]
    for eye in ("eye_left", "eye_right"):
        away = math.degrees(math.acos(walker.mount(eye).rotation[:, 0] @ ahead))
        assert away == pytest.approx(40.0, abs=1.0)


@pytest.mark.parametrize(
    "ahead_m",
    [
        (0.10, 0.09, 0.16),  # beyond the range upwards
        (0.178, 0.15, 0.175),  # to the side and up, within the range in pitch
        (0.05, -0.2, -0.1),
        (-0.3, 0.2, 0.1),  # behind
    ],
)
def test_images_of_a_point_beyond_the_range_are_not_rolled_against_each_other(ahead_m):
    walker = walker_in(empty_world(), eye_range_deg=50.0)
    eyes = ("eye_left", "eye_right")
    head = walker.mount("head").rotation
    middle = sum(walker.mount(eye).position for eye in eyes) / 2.0
    walker.look_toward_point(middle + head @ np.array(ahead_m))
    rotations = [head.T @ walker.mount(eye).rotation for eye in eyes]
    np.testing.assert_allclose(rotations[0][:, 2], rotations[1][:, 2], atol=1e-12)
    for rotation in rotations:
        pitch = math.degrees(math.atan2(rotation[2, 0], rotation[0, 0]))
        yaw = math.degrees(math.asin(rotation[1, 0]))
        assert max(abs(pitch), abs(yaw)) <= 50.0 + 1e-9
        assert rotation[:, 0] @ np.sign(ahead_m) >= 0.0 or ahead_m[0] < 0.0


@pytest.mark.parametrize("wrong", [(1.0, 2.0), (1.0, np.nan, 0.0), "up"])
def test_points_to_look_at_must_be_three_finite_numbers(wrong):
    with pytest.raises(ValueError, match=naming(repr(wrong))):
        walker_in(empty_world()).look_toward_point(wrong)


@pytest.mark.parametrize("aside_m", [-0.05, -0.01, 0.0, 0.01, 0.05])
def test_both_eyes_turn_to_the_same_side_for_a_point_behind(aside_m):
    """Also for one that is to the left of one eye and to the right of the other."""
    walker = walker_in(empty_world())
    head = walker.mount("head")
    walker.look_toward_point(head.position + head.rotation @ np.array([-1.0, aside_m, 0.0]))
    looks = [
        head.rotation.T @ walker.mount(eye).rotation[:, 0] for eye in ("eye_left", "eye_right")
    ]
    left = [math.copysign(1.0, look[1]) for look in looks]
    assert left[0] == left[1]
    assert aside_m == 0.0 or left[0] == math.copysign(1.0, aside_m)
