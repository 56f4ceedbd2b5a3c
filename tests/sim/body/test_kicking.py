"""Kicks: their reach, the speed of a kicked ball, and props that cannot be kicked."""

import math

import numpy as np
import pytest
from walking import ball, box, empty_world, let_pass, walker_in, wall

from veca_marl.sim.physics import ClockCfg, PropCfg, PropShape


@pytest.mark.parametrize("mass_kg", [0.1, 0.5, 2.0])
def test_a_kick_sends_a_ball_away_at_the_documented_speed(mass_kg):
    world = empty_world(ball(mass_kg=mass_kg, position=(0.3, 0.1, 0.1)))
    walker = walker_in(world, kick_speed_mps=3.0, kick_impulse_ns=3.0)
    assert walker.kick(world.prop("ball"))
    velocity = world.prop("ball").velocity
    assert np.linalg.norm(velocity[:2]) == pytest.approx(min(3.0, 3.0 / mass_kg / np.hypot(1, 0.2)))
    assert math.atan2(velocity[1], velocity[0]) == pytest.approx(math.atan2(0.1, 0.3))
    let_pass(world, 0.4)
    assert np.linalg.norm(world.prop("ball").position[:2]) > 0.32


@pytest.mark.parametrize("mass_kg", [0.3, 1.0, 5.0])
@pytest.mark.parametrize("before_mps", [(-3.0, 0.0, 0.0), (0.0, 2.0, 0.5), (2.5, 0.0, 0.0)])
def test_a_kick_adds_an_impulse_up_to_a_speed(mass_kg, before_mps):
    world = empty_world(ball(mass_kg=mass_kg, position=(0.3, 0.0, 0.1)))
    walker = walker_in(world, kick_speed_mps=3.0, kick_impulse_ns=3.0)
    prop, before = world.prop("ball"), np.array(before_mps)
    prop.set_velocity(before_mps)
    assert walker.kick(prop)
    impulse_ns = mass_kg * (prop.velocity - before)
    assert np.linalg.norm(impulse_ns) <= 3.0 + 1e-9
    assert impulse_ns[:2] == pytest.approx([np.linalg.norm(impulse_ns[:2]), 0.0])
    free = np.linalg.norm(impulse_ns) < 3.0 - 1e-6
    assert not free or prop.velocity[0] == pytest.approx(3.0)


def test_a_kick_does_not_slow_a_ball_that_is_faster():
    world = empty_world(ball(position=(0.3, 0.0, 0.1)))
    walker, prop = walker_in(world, kick_speed_mps=3.0), world.prop("ball")
    prop.set_velocity((6.0, 0.0, 0.0))
    assert walker.kick(prop)
    assert prop.velocity == pytest.approx([6.0, 0.0, 0.0])


@pytest.mark.parametrize("speed_mps", [1.0, 4.0])
def test_a_kick_does_not_change_the_spin_of_a_rolling_ball(speed_mps):
    world = empty_world(ball(position=(0.3, 0.0, 0.1)))
    walker, prop = walker_in(world), world.prop("ball")
    spin = (0.0, speed_mps / prop.radius_m, 0.0)
    prop.set_velocity((speed_mps, 0.0, 0.0), spin)
    assert walker.kick(prop)
    assert prop.angular_velocity == pytest.approx(spin)


@pytest.mark.parametrize(
    ("prop_cfg", "reason"),
    [
        (ball(position=(0.5, 0.0, 0.1)), "out of reach"),
        (ball(position=(-0.25, 0.0, 0.1)), "behind"),
        (ball(position=(0.0, 0.25, 0.1)), "to the side"),
        (ball(mass_kg=6.0, position=(0.25, 0.0, 0.1)), "too heavy"),
        (box(mass_kg=0.0, position=(0.3, 0.0, 0.15)), "fixed"),
        (ball(position=(0.25, 0.0, 0.7)), "too high"),
    ],
)
def test_a_kick_is_refused(prop_cfg, reason):
    world = empty_world(prop_cfg)
    walker = walker_in(world)
    prop = world.prop(prop_cfg.name)
    assert not walker.can_kick(prop), reason
    assert not walker.kick(prop)
    np.testing.assert_array_equal(prop.velocity, 0.0)


def test_the_reach_of_a_kick_is_configured():
    reach = []
    for kick_reach_m in (0.1, 0.3):
        world = empty_world(ball())
        walker = walker_in(world, kick_reach_m=kick_reach_m)
        ranges = np.arange(0.2, 1.0, 0.01)
        reachable = []
        for distance_m in ranges:
            world.prop("ball").place((distance_m, 0.0, 0.1))
            reachable.append(walker.can_kick(world.prop("ball")))
        reach.append(ranges[reachable].max() - walker.radius_m - 0.1)
    assert reach == pytest.approx([0.1, 0.3], abs=0.011)


def kicker_before(*props, **numbers):
    """A walker at the origin, and the ball to be kicked."""
    world = empty_world(ball(position=(0.3, 0.0, 0.1), radius_m=0.05), *props)
    return walker_in(world, **numbers), world.prop("ball")


def test_a_kick_does_not_pass_through_a_wall():
    walker, prop = kicker_before(wall(thickness_m=0.1, position=(0.18, 0.0, 0.0)))
    assert walker.position[0] == 0.0
    assert not walker.kick(prop)
    np.testing.assert_array_equal(prop.velocity, 0.0)
    walker._world.prop("wall").place((5.0, 0.0, 0.0), math.pi / 2)
    assert walker.kick(prop)


@pytest.mark.parametrize(
    ("between", "reached"),
    [
        (box("board", (0.02, 1.0, 0.3), 0.0, (0.16, 0.0, 0.15)), False),
        (ball("other", 0.04, 0.3, (0.16, 0.0, 0.1)), False),
        (box("board", (0.02, 1.0, 0.3), 0.0, (0.40, 0.0, 0.15)), True),  # behind the ball
        (box("board", (0.02, 1.0, 0.3), 0.0, (0.16, 0.56, 0.15)), True),  # beside the line
        (box("shelf", (0.02, 1.0, 0.3), 0.0, (0.16, 0.0, 0.75)), True),  # above the line
        (
            PropCfg(
                name="mark",
                shape=PropShape.cylinder,
                size_m=[1.0, 0.3],
                position_m=(0.0, 0.0, 0.1),
                tangible=False,
            ),
            True,
        ),
    ],
)
def test_solid_things_on_the_line_of_contact_prevent_a_kick(between, reached):
    walker, prop = kicker_before(between)
    prop.place((0.3, 0.0, 0.1))
    assert walker.position[0] == 0.0
    assert walker.can_kick(prop) is reached


def test_a_body_on_the_line_of_contact_prevents_a_kick():
    walker, prop = kicker_before(radius_m=0.05)
    assert walker.can_kick(prop) is False  # out of reach
    world = walker._world
    prop.place((0.24, 0.0, 0.1))
    assert walker.can_kick(prop) is True
    walker_in(world, "other", (0.135, 0.09, 0.0), radius_m=0.03)
    assert walker.can_kick(prop) is True
    walker_in(world, "third", (0.12, 0.0, 0.0), radius_m=0.02)
    assert walker.can_kick(prop) is False


def test_a_prop_that_touches_the_walker_can_be_kicked():
    walker, prop = kicker_before()
    for away_m in (0.16, 0.1, 0.02, 0.0):
        prop.place((away_m, 0.0, 0.05))
        assert walker.can_kick(prop), away_m


def test_the_reach_is_measured_to_the_surface_of_a_long_prop():
    """A plank across the way: the corner of the circle about it is near, its side is not."""
    for gap_m, reached in ((0.1, True), (0.3, False), (0.86, False)):
        plank = PropCfg(
            "plank",
            PropShape.box,
            [0.05, 1.6, 0.05],
            (0.11 + gap_m + 0.025, 0.0, 0.11),
            mass_kg=0.5,
        )
        world = empty_world(plank)
        assert walker_in(world).can_kick(world.prop("plank")) is reached


def test_the_direction_of_a_prop_is_that_of_its_centre_of_mass():
    """The origin of its frame is behind the walker."""
    corners = [[x, y, z] for x in (1.0, 1.2) for y in (-0.05, 0.05) for z in (0.0, 0.1)]
    hull = PropCfg("hull", PropShape.convex, [], (0.0, 0.0, 0.05), mass_kg=0.5, points_m=corners)
    world = empty_world(hull)
    walker = walker_in(world, place=(0.8, 0.0, 0.0))
    assert walker.kick(world.prop("hull"))
    assert world.prop("hull").velocity[0] > 1.0
    behind = walker_in(world, "behind", place=(-1.4, 0.0, 0.0))
    assert not behind.can_kick(world.prop("hull"))


@pytest.mark.parametrize(("rate_hz", "speed"), [(25, 0.0), (98, 0.7), (245, 0.0), (245, 0.7)])
def test_the_joints_of_a_kicking_leg_move_at_the_speeds_of_a_child(rate_hz, speed):
    """The pose does not jump at the beginning or the end of the kick."""
    world = empty_world(ball(position=(0.3, 0.0, 0.1)), clock=ClockCfg(rate_hz, 1))
    walker = walker_in(world)
    walker.walk(speed, 0.0)
    for step in range(rate_hz):
        if step == 2:
            assert walker.kick(world.prop("ball"))
        world.step()
        assert np.abs(walker.joint_velocities()).max() < 30.0
