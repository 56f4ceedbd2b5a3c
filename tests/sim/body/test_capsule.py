"""The paper's collision rule: light props are pushed, heavy props and walls stop the walker."""

import math

import numpy as np
import pytest
from refusals import naming
from walking import ball, box, empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.physics import ClockCfg, PropCfg, PropShape

RADIUS_M = 0.11
SLACK_M = 0.004


def depth_in_wall_m(walker, wall_face_x):
    return walker.position[0] + RADIUS_M - wall_face_x


@pytest.mark.parametrize("speed", [1.0, 0.3, -1.0])
def test_a_wall_stops_a_walker(speed):
    world = empty_world(wall(position=(math.copysign(1.0, speed), 0.0, 0.0)))
    walker = walker_in(world)
    walker.walk(speed, 0.0)
    let_pass(world, 8.0)
    reached = abs(walker.position[0])
    assert reached == pytest.approx(0.95 - RADIUS_M, abs=SLACK_M)
    assert abs(walker.position[1]) < SLACK_M
    np.testing.assert_allclose(walker.velocity, 0.0, atol=1e-6)


def test_a_wall_that_is_placed_elsewhere_stops_a_walker_there_and_no_longer_here():
    world = empty_world(wall(position=(1.0, 0.0, 0.0)))
    walker, barrier = walker_in(world), world.prop("wall")
    walker.walk(1.0, 0.0)
    let_pass(world, 0.4)
    barrier.place((2.0, 0.0, 0.0), yaw_rad=math.pi / 2.0)
    let_pass(world, 8.0)
    assert walker.position[0] == pytest.approx(1.95 - RADIUS_M, abs=SLACK_M)
    barrier.place((4.0, 0.0, 0.0))  # along the path: the end of 6 m of wall is at x = 1
    walker.place((0.0, 0.0, 0.0))
    walker.walk(1.0, 0.0)
    let_pass(world, 8.0)
    assert walker.position[0] == pytest.approx(1.0 - RADIUS_M, abs=SLACK_M)


def test_a_fast_walker_does_not_tunnel():
    world = empty_world(wall(position=(3.0, 0.0, 0.0)))
    walker = walker_in(world, walk_speed_mps=10.0)
    walker.walk(10.0, 0.0)
    for _ in range(100):
        world.step()
        assert depth_in_wall_m(walker, 2.95) < 0.01


def test_no_speed_that_is_accepted_tunnels():
    """At the greatest speed the capsule reaches a thin wall in any phase of its last step."""
    world = empty_world(wall(position=(1.0, 0.0, 0.0), thickness_m=0.001))
    limit = RADIUS_M / world.clock.substep_s
    walker = walker_in(world, walk_speed_mps=limit)
    walker.walk(limit, 0.0)
    for start in np.linspace(0.0, 0.11, 23):
        walker.place((start, 0.0, 0.0))
        walker.walk(limit, 0.0)
        let_pass(world, 0.08)
        assert depth_in_wall_m(walker, 1.0) < 0.01


@pytest.mark.parametrize("clock", [ClockCfg(), ClockCfg(substeps=8)])
def test_speeds_that_would_tunnel_are_refused(clock):
    limit = RADIUS_M / clock.substep_s
    world = empty_world(clock=clock)
    with pytest.raises(ValueError, match=naming("walk_speed_mps=30.0", f"{limit:.4g} m/s")):
        walker_in(world, walk_speed_mps=30.0)
    walker = walker_in(world, "slow")
    for speed in (1.01 * limit, -1.01 * limit, math.nan, math.inf):
        with pytest.raises(ValueError, match=naming(speed, f"{limit:.4g} m/s")):
            walker.walk(speed, 0.0)
    with pytest.raises(ValueError, match=r"backward_share=1\.5"):
        WalkerCfg(backward_share=1.5)


def test_a_walker_slides_along_a_wall_at_45_degrees():
    world = empty_world(wall(position=(1.0, 0.0, 0.0), length_m=30.0))
    walker = walker_in(world, yaw_deg=45.0)
    walker.walk(1.0, 0.0)
    let_pass(world, 4.0)
    assert depth_in_wall_m(walker, 0.95) == pytest.approx(0.0, abs=SLACK_M)
    assert walker.velocity[1] == pytest.approx(math.sqrt(0.5), rel=0.02)


@pytest.mark.parametrize("yaw_deg", [20.0, 45.0, 70.0])
def test_a_corner_stops_a_walker(yaw_deg):
    world = empty_world(
        wall("east", position=(1.0, 0.0, 0.0)),
        wall("north", position=(0.0, 1.0, 0.0), yaw_deg=0.0),
    )
    walker = walker_in(world, yaw_deg=yaw_deg)
    walker.walk(1.0, 0.0)
    let_pass(world, 10.0)
    assert walker.position[:2] == pytest.approx([0.95 - RADIUS_M] * 2, abs=SLACK_M)


@pytest.mark.parametrize("half_angle_deg", [20.0, 30.0, 40.0])
def test_an_acute_corner_stops_a_walker(half_angle_deg):
    """Depenetration from one wall penetrates the other: several rounds are needed."""
    tip = np.array([1.0, 0.0])
    walls = []
    for name, side in (("left", 1.0), ("right", -1.0)):
        yaw = math.radians(side * (180.0 - half_angle_deg))
        along = np.array([math.cos(yaw), math.sin(yaw)])
        middle = tip + 1.5 * along
        walls.append(wall(name, 3.0, 0.1, (middle[0], middle[1], 0.0), yaw_deg=math.degrees(yaw)))
    world = empty_world(*walls)
    walker = walker_in(world, place=(-1.5, 0.0, 0.0))
    walker.walk(1.0, 0.0)
    let_pass(world, 5.0)
    depth_m = (RADIUS_M + 0.05) / math.sin(math.radians(half_angle_deg))
    slack_m = SLACK_M / math.sin(math.radians(half_angle_deg))
    assert walker.position[0] == pytest.approx(tip[0] - depth_m, abs=slack_m)
    assert abs(walker.position[1]) < SLACK_M


def test_a_walker_cannot_leave_a_room_through_its_walls():
    walls = [
        wall("east", position=(1.0, 0.0, 0.0)),
        wall("west", position=(-1.0, 0.0, 0.0)),
        wall("north", position=(0.0, 1.0, 0.0), yaw_deg=0.0),
        wall("south", position=(0.0, -1.0, 0.0), yaw_deg=0.0),
    ]
    world = empty_world(*walls)
    walker = walker_in(world)
    rng = np.random.default_rng(0)
    for step in range(1500):
        if step % 20 == 0:
            walker.walk(rng.choice((-1.0, 1.0)), rng.uniform(-2.0, 2.0))
        world.step()
        assert np.abs(walker.position[:2]).max() < 0.95 - RADIUS_M + SLACK_M


@pytest.mark.parametrize("x", [0.9, 0.97, 1.03])
def test_a_walker_placed_in_a_wall_is_moved_beside_it(x):
    world = empty_world(wall(position=(1.0, 0.0, 0.0)))
    walker = walker_in(world, place=(x, 0.0, 0.0))
    away = abs(walker.position[0] - 1.0)
    assert away == pytest.approx(0.05 + RADIUS_M, abs=SLACK_M)
    let_pass(world, 0.2)
    assert abs(walker.position[0] - 1.0) == pytest.approx(away, abs=1e-9)


def test_placing_does_not_depend_on_the_earlier_place():
    places = []
    for before in ((0.95, 0.0, 0.0), (-3.0, 2.0, 0.0)):
        world = empty_world(wall(position=(1.0, 0.0, 0.0)))
        walker = walker_in(world, place=before)
        let_pass(world, 0.08)
        walker.place((0.93, 0.5, 0.0))
        places.append(walker.position)
    np.testing.assert_array_equal(*places)


def test_a_heavy_box_stops_a_walker_and_does_not_move():
    """The position of the box equals that in a world without walking, bit by bit."""
    places = []
    for speed in (1.0, 0.0):
        world = empty_world(box(mass_kg=30.0, position=(1.0, 0.0, 0.15)))
        walker = walker_in(world)
        walker.walk(speed, 0.0)
        let_pass(world, 4.0)
        places.append(world.prop("box").position)
        if speed:
            assert walker.position[0] == pytest.approx(0.85 - RADIUS_M, abs=SLACK_M)
    np.testing.assert_array_equal(*places)


def test_an_intangible_mark_is_no_obstacle():
    mark = PropCfg(
        name="mark",
        shape=PropShape.cylinder,
        size_m=[1.0, 0.004],
        position_m=(0.0, 0.0, 0.002),
        tangible=False,
    )
    walker = walker_in(empty_world(mark))
    for x in np.linspace(-1.5, 1.5, 31):
        walker.place((x, 0.0, 0.0))
        assert walker.position[0] == pytest.approx(x, abs=1e-9)


def test_a_moving_heavy_prop_displaces_the_walker():
    world = empty_world(box(mass_kg=30.0, position=(1.0, 0.0, 0.15), friction=0.0))
    walker = walker_in(world)
    for _ in range(100):
        world.prop("box").set_velocity((-0.5, 0.0, 0.0))
        world.step()
    assert world.prop("box").position[0] == pytest.approx(-1.0, abs=0.05)
    assert walker.position[0] == pytest.approx(-1.15 - RADIUS_M, abs=0.06)


@pytest.mark.parametrize("toy_cfg", [ball("toy"), box("toy", mass_kg=0.5), box("toy", mass_kg=4.0)])
def test_a_light_prop_is_pushed_and_does_not_slow_the_walker(toy_cfg):
    world = empty_world(toy_cfg)
    walker = walker_in(world)
    walker.walk(0.6, 0.0)
    let_pass(world, 2.4)
    assert walker.position[0] == pytest.approx(1.44, abs=1e-9)
    toy = world.prop("toy")
    assert toy.position[0] - toy.cfg.size_m[0] / 2 > walker.position[0] + 0.05
    assert abs(toy.position[1]) < 0.01


@pytest.mark.parametrize(("push_limit_kg", "pushed"), [(1.0, False), (3.0, True)])
def test_the_push_limit_separates_light_from_heavy_props(push_limit_kg, pushed):
    world = empty_world(box(mass_kg=2.0))
    walker = walker_in(world, push_limit_kg=push_limit_kg)
    walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert (world.prop("box").position[0] > 1.5) == pushed
    assert (walker.position[0] > 1.5) == pushed


@pytest.mark.parametrize("aside_m", [0.0, 0.02])
@pytest.mark.parametrize("radius_m", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("speed", [0.6, 1.0])
def test_a_ball_between_walker_and_wall_moves_sideways(aside_m, radius_m, speed):
    """Off the centre line it leaves faster than the walker walks, but with a limited speed."""
    toy = ball(radius_m=radius_m, position=(1.0 - radius_m - 0.05, aside_m, radius_m))
    world = empty_world(wall(position=(1.05, 0.0, 0.0)), toy)
    walker = walker_in(world)
    walker.walk(speed, 0.0)
    fastest = 0.0
    for _ in range(150):
        world.step()
        fastest = max(fastest, float(np.linalg.norm(world.prop("ball").velocity)))
        x, _, z = world.prop("ball").position
        assert x < 1.0  # on this side of the wall
        assert -0.5 * radius_m < z < 1.2
    assert fastest < (3.0 if aside_m == 0.0 else 4.0)


def walk_at_each_other(aside_m):
    """Return a world and two walkers that walk toward each other on lines `aside_m` apart."""
    world = empty_world()
    one = walker_in(world, "one", place=(-1.0, 0.0, 0.0))
    two = walker_in(world, "two", place=(1.0, aside_m, 0.0), yaw_deg=180.0)
    one.walk(1.0, 0.0)
    two.walk(1.0, 0.0)
    return world, one, two


def test_two_walkers_do_not_pass_through_each_other():
    world, one, two = walk_at_each_other(0.01)
    nearest = math.inf
    for _ in range(250):
        world.step()
        nearest = min(nearest, float(np.linalg.norm((one.position - two.position)[:2])))
    assert nearest > 2.0 * RADIUS_M - 0.02


def test_two_walkers_head_on_stop_each_other():
    world, one, two = walk_at_each_other(0.0)
    let_pass(world, 4.0)
    assert two.position[0] - one.position[0] > 2.0 * RADIUS_M - 0.02
    assert abs(one.position[0] + two.position[0]) < 0.05


def test_a_standing_walker_is_pushed_but_not_through_a_wall():
    world = empty_world(wall(position=(1.0, 0.0, 0.0)))
    pusher = walker_in(world, "pusher", place=(-0.5, 0.0, 0.0))
    standing = walker_in(world, "standing", place=(0.5, 0.0, 0.0))
    pusher.walk(1.0, 0.0)
    let_pass(world, 5.0)
    assert depth_in_wall_m(standing, 0.95) < SLACK_M
    assert standing.position[0] - pusher.position[0] > 2.0 * RADIUS_M - 0.02


def test_three_overlapping_walkers_separate():
    world = empty_world()
    walkers = [walker_in(world, f"w{i}", place=(0.01 * i, 0.005 * i, 0.0)) for i in range(3)]
    let_pass(world, 2.0)
    for i in range(3):
        for j in range(i):
            apart = np.linalg.norm((walkers[i].position - walkers[j].position)[:2])
            assert apart > 2.0 * RADIUS_M - 0.01


def test_two_coincident_walkers_separate():
    world = empty_world()
    one, two = walker_in(world, "one"), walker_in(world, "two")
    let_pass(world, 2.0)
    assert np.linalg.norm((one.position - two.position)[:2]) > 2.0 * RADIUS_M - 0.01


def test_pushed_props_stay_on_the_floor():
    """Low, flat, tall and round props in front of a walker that turns and walks."""
    toys = [
        box("slab", (0.3, 0.3, 0.04), 0.3, (0.6, 0.0, 0.02)),
        box("pole", (0.06, 0.06, 0.6), 0.4, (1.4, 0.05, 0.3)),
        ball("marble", 0.02, 0.02, (2.2, 0.02, 0.02)),
        ball("beach", 0.3, 0.1, (3.2, -0.05, 0.3)),
    ]
    world = empty_world(*toys)
    walker = walker_in(world)
    walker.walk(1.0, 0.0)
    for step in range(150):
        walker.walk(1.0, 0.6 * math.sin(0.2 * step))
        world.step()
        for toy in world.props.values():
            assert -0.01 < toy.position[2] < 0.6, toy.name
            assert np.linalg.norm(toy.velocity) < 4.0, toy.name


@pytest.mark.parametrize("rate_hz", [5, 10, 25])
def test_a_heavy_ball_that_rolls_against_a_walker_moves_it_at_every_control_rate(rate_hz):
    heavy = ball("heavy", 0.2, 20.0, (1.5, 0.0, 0.2), rolling_friction=0.0)
    world = empty_world(heavy, clock=ClockCfg(rate_hz, 125 // rate_hz))
    walker = walker_in(world)
    world.prop("heavy").place((1.5, 0.0, 0.2), 0.0, (-3.0, 0.0, 0.0))
    for _ in range(rate_hz):
        world.step()
        apart_m = np.linalg.norm((walker.position - world.prop("heavy").position)[:2])
        assert apart_m > walker.radius_m + 0.2 - 0.04
