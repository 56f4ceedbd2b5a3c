"""The gait: feet on the floor, joint limits, continuity, kick and head."""

import math

import numpy as np
import pytest
from walking import ball, empty_world, let_pass, walker_in

from veca_marl.sim.body.anatomy import Soles, load_skeleton
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.body.walker.neck import Neck

SKELETON = load_skeleton()
SOLES = Soles(SKELETON)
LOW = np.array([joint.low_rad for joint in SKELETON.joints])
HIGH = np.array([joint.high_rad for joint in SKELETON.joints])
WALKS = [(1.0, 0.0), (0.5, 0.0), (0.2, 0.0), (-1.0, 0.0), (0.0, 2.0), (1.0, 1.5), (0.0, 0.0)]


def steps_of(walker, world, steps):
    """Yield the poses of the bones after each step."""
    for _ in range(steps):
        world.step()
        yield walker._drawn.positions, walker._drawn.rotations


@pytest.mark.parametrize("walk", WALKS)
def test_the_lowest_sole_is_on_the_floor(walk):
    world = empty_world()
    walker = walker_in(world)
    walker.walk(*walk)
    for positions, rotations in steps_of(walker, world, 60):
        assert SOLES.lowest_m(positions, rotations) == pytest.approx(0.0, abs=1e-9)
        assert positions[:, 2].min() > 0.0


@pytest.mark.parametrize("walk", WALKS)
def test_joint_angles_are_within_the_limits_before_clipping(walk):
    gait = Gait(SKELETON)
    gait._low, gait._high = np.full(82, -np.inf), np.full(82, np.inf)
    gait._neck.turn = lambda *_, **__: None
    for step in range(100):
        gait.advance(*walk, 0.04)
        if step == 50:
            gait.kick()
        angles = gait.pose(0.0, 0.0)
        for angle, joint in zip(angles, SKELETON.joints, strict=True):
            slack = math.radians(1.0)
            assert joint.low_rad - slack <= angle <= joint.high_rad + slack, joint


@pytest.mark.parametrize("speed", [1.0, 0.6, 0.3, -0.7])
def test_the_foot_in_stance_does_not_slip(speed):
    """At least one sole is at rest at every moment of a steady walk."""
    world = empty_world()
    walker = walker_in(world, walk_speed_mps=1.0)
    walker.walk(speed, 0.0)
    let_pass(world, 1.0)
    feet = [SKELETON.bone("l_foot"), SKELETON.bone("r_foot")]
    places = np.array([p[feet].copy() for p, _ in steps_of(walker, world, 50)])
    slid = np.linalg.norm(np.diff(places, axis=0), axis=2).min(axis=1) / 0.04
    assert np.median(slid) < 0.02 * abs(speed)
    # in the step in which the stance changes, neither foot is at rest for the whole step
    assert np.mean(slid < 0.1 * abs(speed)) > 0.6


@pytest.mark.parametrize(("speed", "turn"), [(0.8, 0.8), (0.5, -1.0), (0.0, 1.5)])
def test_the_foot_in_stance_does_not_slip_on_a_curve(speed, turn):
    """Each foot follows its own circle, so the ankle in stance hardly slips."""
    world = empty_world()
    walker = walker_in(world)
    walker.walk(speed, turn)
    let_pass(world, 1.0)
    feet = [SKELETON.bone("l_foot"), SKELETON.bone("r_foot")]
    places = np.array([p[feet, :2].copy() for p, _ in steps_of(walker, world, 50)])
    slid = np.linalg.norm(np.diff(places, axis=0), axis=2).min(axis=1) / 0.04
    assert np.median(slid) < 0.3 * abs(turn) * 0.045


def test_both_feet_lift_in_turn():
    world = empty_world()
    walker = walker_in(world)
    walker.walk(1.0, 0.0)
    let_pass(world, 1.0)
    feet = [SKELETON.bone("l_foot"), SKELETON.bone("r_foot")]
    heights = np.array([p[feet, 2].copy() for p, _ in steps_of(walker, world, 25)])
    assert (np.ptp(heights, axis=0) > 0.03).all()
    assert np.corrcoef(heights.T)[0, 1] < -0.3


def test_arms_and_legs_swing_in_opposition():
    gait = Gait(SKELETON)
    arm, leg = SKELETON.joint("l_upper_arm", "flexion"), SKELETON.joint("l_thigh", "flexion")
    seen = []
    for _ in range(60):
        gait.advance(1.0, 0.0, 0.04)
        seen.append(gait.pose(0.0, 0.0)[[arm, leg]].copy())
    assert np.corrcoef(np.array(seen[20:]).T)[0, 1] < -0.6


def test_standing_is_still():
    gait = Gait(SKELETON)
    gait.advance(0.0, 0.0, 0.04)
    one = gait.pose(0.0, 0.0).copy()
    gait.advance(0.0, 0.0, 0.04)
    np.testing.assert_array_equal(one, gait.pose(0.0, 0.0))


def test_a_walker_that_stops_returns_to_the_standing_pose():
    gait = Gait(SKELETON)
    standing = gait.pose(0.0, 0.0).copy()
    for speed in (1.0, 0.0):
        for _ in range(40):
            gait.advance(speed, 0.3 * speed, 0.04)
    np.testing.assert_allclose(gait.pose(0.0, 0.0), standing, atol=1e-3)


def test_joint_angles_are_continuous():
    """Joint speeds stay below those of a child although the commands change at once."""
    gait, rng, fastest = Gait(SKELETON), np.random.default_rng(0), 0.0
    before = gait.pose(0.0, 0.0).copy()
    for step in range(400):
        if step % 15 == 0:
            walk = rng.uniform(-1.0, 1.0), rng.uniform(-2.0, 2.0)
        gait.advance(*walk, 0.04)
        now = gait.pose(0.0, 0.0)
        fastest = max(fastest, np.abs(now - before).max() / 0.04)
        before = now.copy()
    assert fastest < 25.0


def test_a_kick_swings_the_right_leg_and_ends():
    world = empty_world(ball(position=(0.3, 0.0, 0.1)))
    walker = walker_in(world)
    let_pass(world, 0.4)
    standing = walker.bone("r_foot").position
    assert walker.kick(world.prop("ball"))
    foot = SKELETON.bone("r_foot")
    path = np.array([p[foot].copy() for p, _ in steps_of(walker, world, 25)]) - standing
    assert path[:4, 0].max() > 0.12
    assert path[:4, 2].max() > 0.05
    np.testing.assert_allclose(path[-1], 0.0, atol=1e-3)


@pytest.mark.parametrize("fraction", [-1.0, -0.5, 0.3, 1.0])
def test_neck_and_head_rotations_add_up_to_the_commanded_angle(fraction):
    world = empty_world()
    walker = walker_in(world, head_pitch_deg=0.0)
    neck = Neck(SKELETON)
    down, left = neck.pitch_range_rad, neck.yaw_range_rad
    pitch = fraction * down[1] if fraction > 0 else -fraction * down[0]
    walker.rotate_up_down_head(math.degrees(pitch))
    world.step()
    forward = walker.mount("head").rotation[:, 0]
    assert math.asin(-forward[2]) == pytest.approx(pitch, abs=1e-9)
    walker.rotate_up_down_head(-math.degrees(pitch))
    walker.rotate_left_right_head(-math.degrees(fraction * left[1]))
    world.step()
    forward = walker.mount("head").rotation[:, 0]
    turned = math.atan2(forward[1], forward[0])
    assert turned == pytest.approx(math.remainder(fraction * left[1], math.tau), abs=1e-9)
