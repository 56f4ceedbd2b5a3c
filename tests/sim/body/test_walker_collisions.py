"""Collisions between walkers, and between walkers and joint-level bodies."""

import math
from itertools import combinations

import numpy as np
import pytest
from walking import empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.walker.walker_collisions import separate

RADIUS_M = 0.11
SLACK_M = 0.003
CORNER = ("east", 1.0, 0.0, 90.0), ("north", 0.0, 1.0, 0.0)
# place, yaw in degrees, forward m/s, turn rad/s: they collide in the centre and at the walls
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


def walkers_in(world, players, mirrored=False):
    side = -1.0 if mirrored else 1.0
    walkers = {}
    for name, ((x, y), yaw_deg, speed, turn) in players:
        walker = walker_in(world, name, (x, side * y, 0.0), side * yaw_deg)
        walker.walk(speed, side * turn)
        walkers[name] = walker
    return walkers


def tracks(world, walkers, seconds=3.0):
    """Return the positions after every step, by name, ``(steps, 2)``."""
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


def test_the_order_of_walkers_does_not_matter():
    seen = []
    for players in (named(PLAYERS), named(PLAYERS)[::-1]):
        world = corner_world()
        seen.append(tracks(world, walkers_in(world, players)))
        world.close()
    for name, track in seen[0].items():
        np.testing.assert_allclose(track, seen[1][name], rtol=0.0, atol=1e-9)


def test_mirrored_walkers_move_mirrored():
    seen = []
    for mirrored in (False, True):
        world = empty_world(wall())
        seen.append(tracks(world, walkers_in(world, named(PLAYERS), mirrored)))
        world.close()
    for name, track in seen[0].items():
        np.testing.assert_allclose(track, seen[1][name] * (1.0, -1.0), rtol=0.0, atol=1e-9)


def test_equal_worlds_move_equally_to_the_byte():
    seen = []
    for _ in range(2):
        world = corner_world()
        seen.append(tracks(world, walkers_in(world, named(PLAYERS))))
        world.close()
    for name, track in seen[0].items():
        assert track.tobytes() == seen[1][name].tobytes()


def test_walkers_do_not_penetrate_each_other_or_walls():
    world = corner_world()
    walkers = walkers_in(world, named(PLAYERS))
    for _ in range(150):
        world.step()
        assert nearest_m(walkers) > 2.0 * RADIUS_M - SLACK_M
        for walker in walkers.values():
            assert walker.position[:2].max() < 0.95 - RADIUS_M + SLACK_M


def test_each_of_two_moves_by_half_of_the_overlap():
    """A walker pushes a standing one at half its speed."""
    world = empty_world()
    pusher = walker_in(world, "pusher", (-0.11, 0.0, 0.0))
    standing = walker_in(world, "standing", (0.11, 0.0, 0.0))
    pusher.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert pusher.position[0] + 0.11 == pytest.approx(1.0, abs=0.01)
    assert standing.position[0] - 0.11 == pytest.approx(1.0, abs=0.01)


def test_the_middle_one_of_three_in_a_line_stays():
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


def test_a_queue_is_compressed_and_keeps_its_order():
    """The last walker pushes three others toward a wall."""
    world = empty_world(wall())
    queue = [walker_in(world, f"w{i}", (0.3 * i - 0.4, 0.0, 0.0)) for i in range(4)]
    for walker in queue:
        walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    gaps = np.diff([walker.position[0] for walker in queue])
    assert (gaps > 2.0 * RADIUS_M - 2.0 * SLACK_M).all()  # four are pressed against the wall
    assert queue[-1].position[0] < 0.95 - RADIUS_M + SLACK_M


def test_many_overlapping_discs_separate_and_come_to_rest():
    """Damping limits each displacement although twelve discs overlap."""
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(12, 2)) * 0.05
    far = np.abs(positions).max() + 12 * 2.0 * RADIUS_M
    radii, points, corrections = np.full(12, RADIUS_M), np.zeros((12, 2)), np.zeros((12, 2))
    for _ in range(400):
        if not separate(positions, points, radii, corrections):
            break
        positions += corrections
        assert np.linalg.norm(corrections, axis=1).max() < 2.0 * RADIUS_M
    assert not separate(positions, points, radii, corrections)
    assert np.abs(positions).max() < far


@pytest.mark.parametrize(
    ("start", "yaw_deg"),
    [((1.0, 0.0, 0.0), 180.0), ((0.0, 1.0, 0.0), -90.0), ((-1.0, 0.3, 0.0), 0.0)],
    ids=["head to head", "head to side", "beside each other"],
)
def test_crawling_walkers_do_not_pass_through_each_other(start, yaw_deg):
    world = empty_world()
    one = walker_in(world, "one", verbs=["crawl"])
    other = walker_in(world, "other", start, yaw_deg, verbs=["crawl"])
    assert one.crawl()
    assert other.crawl()
    other.walk(0.4, 0.0)
    gaps = []
    for _ in range(100):
        world.step()
        points = world.client.getClosestPoints(one.body_id, other.body_id, 2.0)
        gaps.append(min(point.distance_m for point in points))
    assert min(gaps) == pytest.approx(0.0, abs=SLACK_M)


@pytest.mark.parametrize(
    ("way", "one", "other", "distance"),
    [
        ((3.0, 4.0), (0.0, 0.0), (0.0, 0.0), 5.0),
        ((3.0, 0.0), (1.0, 0.0), (0.5, 0.0), 1.5),
        ((0.0, 2.0), (1.0, 0.0), (0.5, 0.0), 2.0),
        ((3.0, 0.0), (1.0, 0.0), (0.0, 1.0), 2.0),
        ((3.0, 4.0), (0.0, 0.0), (3.0, 0.0), 4.0),
        ((2.0, 2.0), (0.5, 0.5), (0.5, -0.5), 1.5 * math.sqrt(2.0)),
    ],
)
def test_stadiums_are_separated_along_the_shortest_way_between_their_axes(
    way, one, other, distance
):
    positions, half_axes = np.array([way, (0.0, 0.0)]), np.array([one, other])
    radii, corrections = np.full(2, distance / 2.0 + 0.1), np.zeros((2, 2))
    assert separate(positions, half_axes, radii, corrections)
    np.testing.assert_allclose(corrections[0], -corrections[1], atol=1e-12)
    assert np.linalg.norm(corrections[0]) == pytest.approx(0.1)
    radii[:] = distance / 2.0 - 1e-6
    assert not separate(positions, half_axes, radii, corrections)


def test_crossed_axes_are_separated_between_their_centres():
    positions, half_axes = np.array([(0.1, 0.0), (0.0, 0.0)]), np.array([(1.0, 0.0), (0.0, 1.0)])
    corrections = np.zeros((2, 2))
    assert separate(positions, half_axes, np.full(2, 0.2), corrections)
    np.testing.assert_allclose(corrections, [(0.2, 0.0), (-0.2, 0.0)], atol=1e-12)


def standing_humanoid(world, place=(0.5, 0.0, 0.0)):
    humanoid = Humanoid("humanoid", HumanoidCfg(detail=Detail.mitten), world)
    humanoid.place(place)
    return humanoid


def gap_m(world, walker, humanoid):
    """Return the distance of the capsule from the nearest bone, negative for penetration."""
    points = world.client.getClosestPoints(walker.body_id, humanoid.body_id, 1.0)
    return min(point.distance_m for point in points)


def test_a_joint_level_body_stops_a_walker_and_is_not_moved():
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


def test_a_moving_joint_level_body_displaces_the_walker():
    world = empty_world()
    humanoid = standing_humanoid(world, (0.0, 0.0, 0.0))
    walker = walker_in(world, place=(0.45, 0.0, 0.0))
    world.client.resetBaseVelocity(humanoid.body_id, (1.5, 0.0, 0.0))
    let_pass(world, 0.6)
    assert walker.position[0] > 0.5
    assert gap_m(world, walker, humanoid) > -0.02


def test_a_walker_with_a_larger_push_limit_pushes_a_joint_level_body():
    pushed = []
    for limit_kg in (5.0, 50.0):
        world = empty_world()
        humanoid = standing_humanoid(world, (0.3, 0.0, 0.0))
        walker = walker_in(world, place=(-0.1, 0.0, 0.0), push_limit_kg=limit_kg)
        walker.walk(1.0, 0.0)
        let_pass(world, 0.6)
        pushed.append(humanoid.position[0])
        world.close()
    assert math.isfinite(pushed[1])
    assert pushed[1] > pushed[0] + 0.05
