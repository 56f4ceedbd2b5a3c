"""Kicks: their reach, the speed of a kicked ball, and props that cannot be kicked."""

import math

import numpy as np
import pytest
from walking import ball, box, empty_world, let_pass, walker_in


@pytest.mark.parametrize("mass_kg", [0.1, 0.5, 2.0])
def test_a_kick_sends_a_ball_away_at_the_documented_speed(mass_kg):
    world = empty_world(ball(mass_kg=mass_kg, position=(0.3, 0.1, 0.1)))
    walker = walker_in(world, kick_speed_mps=3.0, kick_impulse_ns=3.0)
    assert walker.kick(world.prop("ball"))
    velocity = world.prop("ball").velocity
    assert np.linalg.norm(velocity[:2]) == pytest.approx(min(3.0, 3.0 / mass_kg))
    assert math.atan2(velocity[1], velocity[0]) == pytest.approx(math.atan2(0.1, 0.3))
    let_pass(world, 0.4)
    assert np.linalg.norm(world.prop("ball").position[:2]) > 0.32


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
