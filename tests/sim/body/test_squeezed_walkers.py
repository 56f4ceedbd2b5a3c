"""Fixed things win: whatever presses a walker against a wall, it stays on its side of the wall."""

import math

import numpy as np
import pytest
from walking import ball, box, empty_world, walker_in, wall

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.physics import JointCfg, PropCfg, PropShape

RADIUS_M = 0.11
FACE_M = 1.0  # the near face of the wall
SLACK_M = 0.002


def wall_ahead(thickness_m, name="wall", yaw_deg=90.0):
    """Return a wall whose near face is at a metre along x, or along y at a yaw of 0."""
    middle = FACE_M + thickness_m / 2.0
    position = (middle, 0.0, 0.0) if yaw_deg else (0.0, middle, 0.0)
    return wall(name, thickness_m=thickness_m, position=position, yaw_deg=yaw_deg)


def wall_below(y):
    """Return a wall along x whose upper face is at `y`."""
    return wall("south", thickness_m=0.05, position=(0.0, y - 0.025, 0.0), yaw_deg=0.0)


def heavy_box(name="heavy", mass_kg=30.0, position=(0.0, 0.0, 0.2)):
    return box(name, (0.4, 0.4, 0.4), mass_kg, position, friction=0.0)


def start(*props, place, **numbers):
    """Return a world and a walker in it that stands at a place."""
    world = empty_world(*props)
    walker = walker_in(world, **numbers)
    world.freeze()
    world.reset(np.random.default_rng(0))
    walker.place(place)
    world.refresh()
    return world, walker


def step_and_watch(world, walker, seconds, most_x=math.inf, most_y=math.inf, least_y=-math.inf):
    """Step, and check after each step that the walker is within bounds."""
    for _ in range(round(seconds / 0.04)):
        world.step()
        x, y = walker.position[:2]
        assert x < most_x - RADIUS_M + SLACK_M
        assert y < most_y - RADIUS_M + SLACK_M
        assert y > least_y + RADIUS_M - SLACK_M


HEAVY = [
    heavy_box(),
    heavy_box(mass_kg=6.0),
    ball("heavy", 0.25, 30.0, (0.0, 0.0, 0.25), rolling_friction=0.0),
    ball("heavy", 0.25, 10.0, (0.0, 0.03, 0.25), rolling_friction=0.0),
]


@pytest.mark.parametrize("heavy", HEAVY, ids=["box", "light_box", "ball", "ball_aside"])
@pytest.mark.parametrize("thickness_m", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("speed", [0.5, 1.5, 3.0])
def test_a_heavy_thing_does_not_push_a_walker_through_a_wall(heavy, thickness_m, speed):
    world, walker = start(wall_ahead(thickness_m), heavy, place=(0.85, 0.0, 0.0))
    world.prop("heavy").set_velocity((speed, 0.0, 0.0))
    step_and_watch(world, walker, 2.0, most_x=FACE_M)


@pytest.mark.parametrize("speed", [0.5, 1.0, 1.5])
def test_what_squeezes_a_walker_is_stopped(speed):
    """It comes no nearer to the wall than the walker is wide, and rebounds with little speed."""
    world, walker = start(wall_ahead(0.05), heavy_box(), place=(0.85, 0.0, 0.0))
    heavy = world.prop("heavy")
    heavy.set_velocity((speed, 0.0, 0.0))
    for _ in range(75):
        world.step()
        free_m = FACE_M - (heavy.position[0] + 0.2)
        assert free_m > 2.0 * RADIUS_M - 2.0 * speed * world.clock.substep_s - SLACK_M
    assert -0.3 * speed < heavy.velocity[0] < 0.01
    apart_m = walker.position[0] - RADIUS_M - (heavy.position[0] + 0.2)
    assert apart_m > -SLACK_M


def test_a_heavy_thing_that_is_driven_all_the_time_does_not_push_a_walker_through_a_corner():
    world, walker = start(
        wall_ahead(0.05),
        wall_ahead(0.05, "north", 0.0),
        heavy_box(position=(0.0, 0.6, 0.2)),
        place=(0.85, 0.6, 0.0),
    )
    for _ in range(100):
        world.prop("heavy").set_velocity((0.5, 0.4, 0.0))
        step_and_watch(world, walker, 0.04, most_x=FACE_M, most_y=FACE_M)


def test_two_heavy_things_at_once_do_not_push_a_walker_through_a_wall():
    """One along the wall from either side, and one across it."""
    world, walker = start(
        wall_below(-0.15),
        heavy_box("left", position=(-0.6, 0.1, 0.2)),
        heavy_box("right", position=(0.6, 0.1, 0.2)),
        heavy_box("above", position=(0.0, 0.7, 0.2)),
        place=(0.0, 0.0, 0.0),
    )
    world.prop("left").set_velocity((1.0, 0.0, 0.0))
    world.prop("right").set_velocity((-1.0, 0.0, 0.0))
    world.prop("above").set_velocity((0.0, -1.0, 0.0))
    step_and_watch(world, walker, 2.0, least_y=-0.15)


def test_two_heavy_things_that_meet_at_a_walker_are_stopped_by_it():
    world, _ = start(
        heavy_box("left", position=(-0.6, 0.0, 0.2)),
        heavy_box("right", position=(0.6, 0.0, 0.2)),
        place=(0.0, 0.0, 0.0),
    )
    left, right = world.prop("left"), world.prop("right")
    left.set_velocity((1.0, 0.0, 0.0))
    right.set_velocity((-1.0, 0.0, 0.0))
    for _ in range(50):
        world.step()
        assert right.position[0] - left.position[0] - 0.4 > 2.0 * RADIUS_M - 0.04


def test_a_light_thing_that_a_heavy_one_presses_against_a_walker_does_not_push_it_through_a_wall():
    world, walker = start(
        wall_ahead(0.05),
        heavy_box(),
        box("light", (0.2, 0.2, 0.3), 0.5, (0.4, 0.0, 0.15)),
        place=(0.85, 0.0, 0.0),
    )
    world.prop("heavy").set_velocity((1.5, 0.0, 0.0))
    step_and_watch(world, walker, 2.0, most_x=FACE_M)


@pytest.mark.parametrize("mass_kg", [3.0, 20.0])
def test_a_door_with_a_motor_does_not_push_a_walker_through_a_wall(mass_kg):
    joint = JointCfg(axis=(0.0, 0.0, -1.0), anchor_m=(0.0, -0.45, 0.0), range_deg=100.0)
    door = PropCfg(
        "door", PropShape.box, [0.04, 0.9, 1.0], (0.6, 0.0, 0.55), mass_kg=mass_kg, joint=joint
    )
    world, walker = start(wall_ahead(0.05), door, place=(0.85, 0.2, 0.0))
    world.prop("door").open()
    step_and_watch(world, walker, 6.0, most_x=FACE_M)


@pytest.mark.parametrize("seed", range(3))
def test_a_joint_level_body_does_not_push_a_walker_through_a_wall(seed):
    world = empty_world(wall_ahead(0.05))
    walker = walker_in(world)
    body = Humanoid("child", HumanoidCfg(detail=Detail.mitten), world)
    world.freeze()
    rng = np.random.default_rng(seed)
    world.reset(rng)
    body.place((0.45, rng.uniform(-0.1, 0.1), 0.35), rng.uniform(-math.pi, math.pi))
    walker.place((0.85, 0.0, 0.0))
    world.refresh()
    for _ in range(50):
        spin = world.client.getBaseVelocity(body.body_id)[1]
        world.client.resetBaseVelocity(body.body_id, (1.5, 0.0, 0.0), spin)
        step_and_watch(world, walker, 0.04, most_x=FACE_M)


def test_a_walker_between_a_wall_and_a_heavy_ball_does_not_move_the_ball():
    world, walker = start(
        wall_ahead(0.05), ball("heavy", 0.25, 30.0, (0.7, 0.6, 0.25)), place=(0.87, 0.0, 0.0)
    )
    walker.place((0.87, 0.0, 0.0), math.pi / 2.0)
    walker.walk(1.0, 0.0)
    before = world.prop("heavy").position
    step_and_watch(world, walker, 3.0, most_x=FACE_M)
    np.testing.assert_allclose(world.prop("heavy").position, before, atol=0.01)


def test_a_walker_walks_away_from_where_it_was_squeezed():
    world, walker = start(wall_ahead(0.05), heavy_box(), place=(0.85, 0.0, 0.0))
    for _ in range(20):
        world.prop("heavy").set_velocity((0.5, 0.0, 0.0))
        step_and_watch(world, walker, 0.04, most_x=FACE_M)
    walker.place(walker.position, math.pi / 2.0)
    walker.walk(1.0, 0.0)
    step_and_watch(world, walker, 1.5, most_x=FACE_M)
    assert walker.position[1] > 1.0


def test_a_crawling_walker_that_turns_between_two_walls_stays_between_them():
    world, walker = start(
        wall_below(-0.2),
        wall("north", thickness_m=0.05, position=(0.0, 0.225, 0.0), yaw_deg=0.0),
        place=(0.0, 0.0, 0.0),
        verbs=["crawl"],
    )
    assert walker.crawl()
    walker.walk(0.0, 1.0)
    for _ in range(100):
        world.step()
        walker.walk(0.4, 0.3)
        assert abs(walker.position[1]) < 0.15


def test_a_reset_after_a_squeeze_restores_the_world_bit_by_bit():
    """Whatever the walker was squeezed by in an earlier episode."""

    def episode(world, walker):
        world.reset(np.random.default_rng(1))
        walker.place((0.85, 0.0, 0.0))
        world.prop("heavy").set_velocity((0.9, 0.1, 0.0))
        places = []
        for _ in range(60):
            world.step()
            places.append([*walker.position, *world.prop("heavy").position])
        return np.array(places)

    props = wall_ahead(0.05), heavy_box(), box("light", (0.2, 0.2, 0.3), 0.5, (0.4, 0.0, 0.15))
    world, walker = start(*props, place=(0.0, -1.0, 0.0))
    fresh = episode(world, walker)
    world.reset(np.random.default_rng(2))
    walker.place((0.85, 0.1, 0.0))
    for _ in range(7):
        world.prop("heavy").set_velocity((2.0, 0.0, 0.0))
        world.step()
    np.testing.assert_array_equal(episode(world, walker), fresh)


@pytest.mark.parametrize("kind", ["wall", "heavy", "light"])
def test_it_touches_what_stops_it_and_what_it_pushes(kind):
    ahead = {
        "wall": wall_ahead(0.1, "thing"),
        "heavy": heavy_box("thing", position=(1.0, 0.0, 0.2)),
        "light": box("thing", (0.2, 0.2, 0.2), 0.5, (1.0, 0.0, 0.1)),
    }[kind]
    world, walker = start(ahead, place=(0.3, 0.0, 0.0))
    thing = world.prop("thing")
    world.step()
    assert not walker.touches(thing)
    walker.walk(1.0, 0.0)
    touched = False
    for _ in range(40):
        world.step()
        touched |= walker.touches(thing)
    assert touched
    if kind != "light":
        assert walker.touches(thing)
        walker.walk(-0.5, 0.0)
        for _ in range(5):
            world.step()
        assert not walker.touches(thing)
