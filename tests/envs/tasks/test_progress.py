"""Forward speed: what it rewards, and motions to and fro."""

import math

import numpy as np
import pytest
from babies import child_game, rest

from veca_marl.envs.tasks.locomotion.motor_skills import ForwardProgress
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS, STANDING

STEP_S, TOP_MPS = 0.04, 1.0
EAST = np.array([1.0, 0.0, 0.0])


def facing(yaw_deg, pitch_deg=0.0):
    yaw, share = math.radians(yaw_deg), math.cos(math.radians(pitch_deg))
    return share * np.array([math.cos(yaw), math.sin(yaw), 0.0])


def speeds(*steps):
    """Return the speed in each step, from displacements ``(2,)`` m and directions."""
    progress, position, found = ForwardProgress(STEP_S, TOP_MPS), np.zeros(3), []
    progress.reset(position, EAST)
    for (ahead_m, left_m), forward in steps:
        position = position + np.array([ahead_m, left_m, 0.01])
        progress.update(position, forward)
        found.append(progress.speed_mps)
    return found


@pytest.mark.parametrize(
    ("step", "speed"),
    [
        (((0.02, 0.0), facing(0.0)), 0.5),
        (((0.02, 0.0), facing(60.0)), 0.25),  # sideways to the body
        (((0.02, 0.0), facing(0.0, 60.0)), 0.25),  # bent over
        (((0.0, 0.02), facing(90.0)), 0.0),  # across the direction of the start
        (((-0.02, 0.0), facing(180.0)), -0.5),
        (((0.2, 0.0), facing(0.0)), TOP_MPS),
    ],
)
def test_the_speed_is_the_smaller_component(step, speed):
    assert speeds(step) == pytest.approx([speed], abs=1e-9)


def test_rocking_slowly_forward_and_fast_backward_is_not_rewarded():
    """With a symmetric limit, 4 x 15 mm forward and 60 mm back added up to 20 mm a cycle."""
    cycle = [((0.015, 0.0), facing(0.0))] * 4 + [((-0.06, 0.0), facing(0.0))]
    assert sum(speeds(*cycle * 10)) <= 1e-9


def test_bending_over_on_the_way_back_is_not_rewarded():
    cycle = [((0.03, 0.0), facing(0.0)), ((-0.03, 0.0), facing(0.0, 89.0))]
    assert sum(speeds(*cycle * 10)) <= 1e-9


def test_swaying_with_the_heading_is_not_rewarded():
    """To the left facing left, to the right facing right."""
    cycle = [((0.0, 0.03), facing(40.0)), ((0.0, -0.03), facing(-40.0))]
    assert sum(speeds(*cycle * 10)) <= 1e-9


def test_no_random_cycle_is_rewarded():
    rng = np.random.default_rng(0)
    for _ in range(100):
        ways = rng.normal(0.0, 0.03, (9, 2))
        ways = [*ways, -ways.sum(axis=0)]
        turns = [facing(*rng.uniform(-180.0, 180.0, 2)) for _ in ways]
        assert sum(speeds(*zip(ways, turns, strict=True))) <= 1e-9


@pytest.mark.parametrize(("task", "posture"), [("CrawlBaby", ON_ALL_FOURS), ("RunBaby", STANDING)])
def test_a_body_that_rocks_slowly_forward_and_fast_backward_earns_nothing(task, posture):
    """It is moved 4 x 40 mm forward and 160 mm back, faster than the limit, eight times."""
    with child_game(task) as game:
        body, earned = game.players[0].body, []
        ahead = body.forward  # at the start, the direction that is rewarded
        yaw_rad = math.atan2(ahead[1], ahead[0])
        body.place((0.0, 0.0, 0.0), yaw_rad, posture)
        rest(game)  # the reward of the way from the start is not counted
        for place_m in [0.04, 0.08, 0.12, 0.16, 0.0] * 8:
            body.place(place_m * ahead, yaw_rad, posture)
            earned.append(rest(game).terms["agents"]["forward"] * game.world.clock.step_s)
    assert max(earned) == pytest.approx(0.04, abs=0.01), "the way forward is rewarded"
    assert sum(earned) < 0.02
