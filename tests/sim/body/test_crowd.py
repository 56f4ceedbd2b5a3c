"""Walkers among walkers and beside joint-level bodies: who gives way to whom."""

import math
from itertools import combinations

import numpy as np
import pybullet
import pytest
from walking import empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.walker.walker_collisions import separate

RADIUS_M = 0.11
SLACK_M = 0.003
CORNER = ("east", 1.0, 0.0, 90.0), ("north", 0.0, 1.0, 0.0)
# place, yaw in degrees, forward m/s, turn rad/s: they meet in the middle and at the walls
PLAYERS = (
    ((-0.6, 0.13), 0.0, 1.0, 0.0),
    ((0.6, 0.07), 175.0, 0.8, 0.1),
    ((0.1, -0.7), 80.0, 0.9, 0.2),
    ((0.7, 0.6), 30.0, 1.0, -0.1),
    ((0.5, 0.75), 45.0, 0.7, 0.0),
)


def corner_world():
    walls = [wall(n, position=(x, y, 0.0), yaw_deg=yaw) for n, x, y, yaw in CORNER]
    return empty_world(*walls)


def crowd(world, players, mirrored=False):
    side = -1.0 if mirrored else 1.0
    walkers = {}
    for name, ((x, y), yaw_deg, speed, turn) in players:
        walker = walker_in(world, name, (x, side * y, 0.0), side * yaw_deg)
        walker.walk(speed, side * turn)
        walkers[name] = walker
    return walkers


def tracks(world, walkers, seconds=3.0):
    """Where everyone is after every step, by name, ``(steps, 2)``."""
    seen = {name: [] for name in walkers}
    for _ in range(round(seconds / 0.04)):
        world.step()
        for name, walker in walkers.items():
            seen[name].append(walker.position[:2])
    return {name: np.array(places) for name, places in seen.items()}


def nearest_m(walkers):
    places = [walker.position[:2] for walker in walkers.values()]
    return min(float(np.linalg.norm(a - b)) for a, b in combinations(places, 2))


def named(players):
    return [(f"w{index}", player) for index, player in enumerate(players)]


def test_the_order_of_players_does_not_matter():
    seen = []
    for players in (named(PLAYERS), named(PLAYERS)[::-1]):
        world = corner_world()
        seen.append(tracks(world, crowd(world, players)))
        world.close()
    for name, track in seen[0].items():
        np.testing.assert_allclose(track, seen[1][name], rtol=0.0, atol=1e-9)


def test_a_mirrored_crowd_moves_as_in_a_mirror():
    seen = []
    for mirrored in (False, True):
        world = empty_world(wall())
        seen.append(tracks(world, crowd(world, named(PLAYERS), mirrored)))
        world.close()
    for name, track in seen[0].items():
        np.testing.assert_allclose(track, seen[1][name] * (1.0, -1.0), rtol=0.0, atol=1e-9)


def test_the_same_crowd_moves_the_same_to_the_byte():
    seen = []
    for _ in range(2):
        world = corner_world()
        seen.append(tracks(world, crowd(world, named(PLAYERS))))
        world.close()
    for name, track in seen[0].items():
        assert track.tobytes() == seen[1][name].tobytes()


def test_nobody_stands_in_anybody_or_in_a_wall():
    world = corner_world()
    walkers = crowd(world, named(PLAYERS))
    for _ in range(150):
        world.step()
        assert nearest_m(walkers) > 2.0 * RADIUS_M - SLACK_M
        for walker in walkers.values():
            assert walker.position[:2].max() < 0.95 - RADIUS_M + SLACK_M


def test_two_split_the_push_out_in_half():
    """One who walks into one who stands shoves it at half its speed."""
    world = empty_world()
    pusher = walker_in(world, "pusher", (-0.11, 0.0, 0.0))
    victim = walker_in(world, "victim", (0.11, 0.0, 0.0))
    pusher.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert pusher.position[0] + 0.11 == pytest.approx(1.0, abs=0.01)
    assert victim.position[0] - 0.11 == pytest.approx(1.0, abs=0.01)


def test_of_three_in_a_line_the_middle_one_is_held():
    world = empty_world()
    left = walker_in(world, "left", (-0.5, 0.0, 0.0))
    middle = walker_in(world, "middle")
    right = walker_in(world, "right", (0.5, 0.0, 0.0), 180.0)
    left.walk(1.0, 0.0)
    right.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert middle.position[0] == pytest.approx(0.0, abs=1e-9)
    assert left.position[0] == pytest.approx(-2.0 * RADIUS_M, abs=SLACK_M)
    assert right.position[0] == pytest.approx(2.0 * RADIUS_M, abs=SLACK_M)


def test_a_queue_is_shoved_together_and_stays_a_queue():
    """The last pushes three others; before them is a wall."""
    world = empty_world(wall())
    queue = [walker_in(world, f"w{i}", (0.3 * i - 0.4, 0.0, 0.0)) for i in range(4)]
    for walker in queue:
        walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    gaps = np.diff([walker.position[0] for walker in queue])
    assert (gaps > 2.0 * RADIUS_M - 2.0 * SLACK_M).all()  # four press together on the wall
    assert queue[-1].position[0] < 0.95 - RADIUS_M + SLACK_M


def test_a_throng_comes_to_rest():
    """Twelve on one heap part without being thrown: damping keeps the pushes from adding up."""
    rng = np.random.default_rng(0)
    places = rng.normal(size=(12, 2)) * 0.05
    far = np.abs(places).max() + 12 * 2.0 * RADIUS_M
    radii, shoves = np.full(12, RADIUS_M), np.zeros((12, 2))
    for _ in range(400):
        if not separate(places, radii, shoves):
            break
        places += shoves
        assert np.linalg.norm(shoves, axis=1).max() < 2.0 * RADIUS_M
    assert not separate(places, radii, shoves)
    assert np.abs(places).max() < far


def standing_humanoid(world, place=(0.5, 0.0, 0.0)):
    humanoid = Humanoid("humanoid", HumanoidCfg(detail=Detail.mitten), world)
    humanoid.place(place)
    return humanoid


def gap_m(world, walker, humanoid):
    """Distance of the capsule from the nearest bone, negative inside."""
    points = pybullet.getClosestPoints(
        walker.body_id,
        humanoid.body_id,
        1.0,
        physicsClientId=world.client,
    )
    return min(point[8] for point in points)


def test_a_joint_level_body_is_heavy_it_stops_a_walker_and_feels_nothing():
    falls = []
    for with_walker in (False, True):
        world = empty_world()
        humanoid = standing_humanoid(world)
        if with_walker:
            walker = walker_in(world, place=(-0.2, 0.0, 0.0))
            walker.walk(1.0, 0.0)
        for _ in range(20):
            world.step()
            if with_walker:
                assert gap_m(world, walker, humanoid) > -0.02
        falls.append(humanoid.bone_positions().copy())
        world.close()
    np.testing.assert_allclose(falls[0], falls[1], rtol=0.0, atol=1e-9)


def test_a_joint_level_body_that_comes_shoves_the_walker_aside():
    world = empty_world()
    humanoid = standing_humanoid(world, (0.0, 0.0, 0.0))
    walker = walker_in(world, place=(0.45, 0.0, 0.0))
    pybullet.resetBaseVelocity(humanoid.body_id, (1.5, 0.0, 0.0), physicsClientId=world.client)
    let_pass(world, 0.6)
    assert walker.position[0] > 0.5
    assert gap_m(world, walker, humanoid) > -0.02


def test_a_walker_with_a_greater_limit_shoves_a_joint_level_body():
    shoved = []
    for limit_kg in (5.0, 50.0):
        world = empty_world()
        humanoid = standing_humanoid(world, (0.3, 0.0, 0.0))
        walker = walker_in(world, place=(-0.1, 0.0, 0.0), push_limit_kg=limit_kg)
        walker.walk(1.0, 0.0)
        let_pass(world, 0.6)
        shoved.append(humanoid.position[0])
        world.close()
    assert math.isfinite(shoved[1])
    assert shoved[1] > shoved[0] + 0.05
