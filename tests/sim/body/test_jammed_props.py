"""Light things between a walker and something that does not give way stop the walker."""

import math
from dataclasses import replace

import numpy as np
import pytest
from walking import ball, box, empty_world, walker_in, wall

from veca_marl.sim.physics import JointCfg, PropCfg, PropShape
from veca_marl.sim.physics.props.toys import fraction_piece, key

WALL_M = 1.55  # the near face of the wall
SPEED_MPS = 1.0
HALF_LEAF_M = 0.02  # deeper a capsule would leave the leaf on its other side


def thin(kind):
    """Return a thin prop that lies at x = 1 m."""
    if kind == "key":
        return key("thing", (1.0, 0.0))
    return fraction_piece("thing", {"half": 0.5, "quarter": 0.25}[kind], (1.0, 0.0))


def depth_m(world, one, other):
    points = world.client.getClosestPoints(
        world.props[one].body_id if isinstance(one, str) else one.body_id,
        world.props[other].body_id,
        0.0,
    )
    return max((-point.distance_m for point in points), default=0.0)


def door(mass_kg=4.0):
    joint = JointCfg(axis=(0.0, 0.0, -1.0), anchor_m=(0.0, -0.45, 0.0), range_deg=100.0)
    return PropCfg(
        "door", PropShape.box, [0.04, 0.9, 1.0], (1.0, 0.0, 0.55), mass_kg=mass_kg, joint=joint
    )


@pytest.mark.slow
@pytest.mark.parametrize("crawls", [False, True])
@pytest.mark.parametrize("kind", ["half", "quarter", "key"])
def test_no_thin_thing_is_driven_into_the_wall_or_the_floor(kind, crawls):
    world = empty_world(wall(position=(1.6, 0.0, 0.0)), thin(kind))
    walker, thing = walker_in(world, verbs=["crawl"]), world.prop("thing")
    world.freeze()
    for seed in range(12):
        rng = np.random.default_rng(seed)
        world.reset(rng)
        walker.place((0.0, 0.0, 0.0))
        if crawls:
            assert walker.crawl()
        place = (1.0, rng.uniform(-0.08, 0.08), thing.position[2])
        thing.place(place, rng.uniform(-math.pi, math.pi))
        for _ in range(100):
            walker.walk(SPEED_MPS, rng.uniform(-0.5, 0.5))
            world.step()
            low, high = thing.bounds()
            middle = (low + high) / 2.0
            assert middle[2] > 0.0
            assert middle[0] < WALL_M
            assert depth_m(world, "thing", "wall") < 0.02


@pytest.mark.parametrize(
    "behind",
    [
        PropCfg("behind", PropShape.box, [0.4, 0.4, 0.5], (1.35, 0.3, 0.25)),
        PropCfg("behind", PropShape.box, [0.4, 0.4, 0.5], (1.35, 0.3, 0.25), mass_kg=60.0),
    ],
    ids=["fixed", "heavy"],
)
def test_a_walker_does_not_pass_through_a_door_that_furniture_blocks(behind):
    world = empty_world(door(), behind)
    walker = walker_in(world, place=(0.0, 0.2, 0.0))
    walker.walk(SPEED_MPS, 0.0)
    for _ in range(60):
        world.step()
        assert depth_m(world, walker, "door") < HALF_LEAF_M
    assert world.prop("door").opening < 0.2


@pytest.mark.parametrize("speed_mps", [0.0, SPEED_MPS])
def test_a_walker_does_not_pass_through_a_door_that_another_one_blocks(speed_mps):
    world = empty_world(door())
    walker = walker_in(world, "one", (0.0, 0.2, 0.0))
    other = walker_in(world, "other", (1.6, 0.2, 0.0), yaw_deg=180.0)
    walker.walk(SPEED_MPS, 0.0)
    other.walk(speed_mps, 0.0)
    for _ in range(60):
        world.step()
        assert depth_m(world, walker, "door") < HALF_LEAF_M
        assert depth_m(world, other, "door") < HALF_LEAF_M


def test_two_walkers_hold_a_ball_between_them():
    world = empty_world(ball(position=(0.0, 0.0, 0.1)))
    one = walker_in(world, "one", (-1.0, 0.0, 0.0))
    other = walker_in(world, "other", (1.0, 0.0, 0.0), yaw_deg=180.0)
    for walker in (one, other):
        walker.walk(SPEED_MPS, 0.0)
    for _ in range(60):
        world.step()
        # the ball of 0.2 m stays between the capsules, or leaves them to the side
        ball_y = abs(world.prop("ball").position[1])
        gap_m = other.position[0] - one.position[0] - 2 * one.radius_m
        assert gap_m > 0.18 or ball_y > 0.1


@pytest.mark.parametrize(
    "thing",
    [ball("thing"), box("thing"), thin("half"), thin("key"), box("thing", mass_kg=4.9)],
    ids=["ball", "box", "half", "key", "heavy box"],
)
def test_what_can_move_does_not_slow_a_walker_down(thing):
    world = empty_world(thing)
    walker = walker_in(world, place=(0.5, 0.0, 0.0))
    walker.walk(SPEED_MPS, 0.0)
    for _ in range(50):
        world.step()
    assert walker.position[0] == pytest.approx(0.5 + 50 * 0.04 * SPEED_MPS, abs=1e-6)
    assert world.prop("thing").position[0] > 1.5


def row_of_boxes(count, mass_kg=0.5):
    return [
        box(f"thing_{n}", (0.2, 0.2, 0.2), mass_kg, (1.0 + 0.205 * n, 0.0, 0.1))
        for n in range(count)
    ]


@pytest.mark.parametrize("mass_kg", [0.3, 4.9])
@pytest.mark.parametrize("count", [2, 4])
def test_a_row_of_boxes_that_can_move_does_not_slow_a_walker_down(count, mass_kg):
    """Each is supported by the next one, which gives way."""
    world = empty_world(*row_of_boxes(count, mass_kg))
    walker = walker_in(world, place=(0.5, 0.0, 0.0))
    walker.walk(SPEED_MPS, 0.0)
    for _ in range(40):
        world.step()
    assert walker.position[0] == pytest.approx(0.5 + 40 * 0.04 * SPEED_MPS, abs=1e-6)
    assert world.prop(f"thing_{count - 1}").position[0] > 1.9 + 0.2 * (count - 1)


def test_a_row_of_boxes_stops_a_walker_where_it_meets_a_wall():
    world = empty_world(*row_of_boxes(3), wall(position=(2.0, 0.0, 0.0)))
    walker = walker_in(world, place=(0.5, 0.0, 0.0))
    walker.walk(SPEED_MPS, 0.0)
    for _ in range(80):
        world.step()
        for n in range(3):
            assert depth_m(world, f"thing_{n}", "wall") < 0.01
            assert depth_m(world, walker, f"thing_{n}") < 0.02


def test_a_door_is_pushed_open_with_a_light_box_behind_it():
    world = empty_world(door(), box("thing", position=(1.2, 0.2, 0.15)))
    walker = walker_in(world, place=(0.0, 0.2, 0.0))
    walker.walk(SPEED_MPS, 0.0)
    for _ in range(60):
        world.step()
    assert world.prop("door").opening > 0.5
    assert walker.position[0] > 1.5


@pytest.mark.parametrize("speed_mps", [0.0, 0.3])
@pytest.mark.parametrize("thing", [ball("thing"), box("thing")], ids=["ball", "box"])
def test_walkers_with_a_thing_between_them_move_alike_in_any_order(thing, speed_mps):
    """The one pushes the other back, as it does without the thing."""
    places = {"one": ((-1.0, 0.0, 0.0), 0.0), "other": ((1.03, 0.0, 0.0), 180.0)}
    ends = []
    for order in (("one", "other"), ("other", "one")):
        world = empty_world(replace(thing, position_m=(0.0, 0.0, thing.position_m[2])))
        walkers = {name: walker_in(world, name, *places[name]) for name in order}
        walkers["one"].walk(SPEED_MPS, 0.0)
        walkers["other"].walk(speed_mps, 0.0)
        for _ in range(50):
            world.step()
        ends.append([walkers[name].position[0] for name in ("one", "other")])
    np.testing.assert_allclose(ends[0], ends[1], atol=0.05)
    assert ends[0][1] > 1.03 - 50 * 0.04 * speed_mps + 0.1
