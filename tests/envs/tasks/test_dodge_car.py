"""The toy car, and DodgeCar: driving, contacts, rewards, hiding places, the expert."""

import math

import numpy as np
import pytest
import started
from composed import compose
from refusals import naming

from veca_marl.config import ConfigError
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.senses import make_senses

SMALL_EYES = ("senses.vision.width=16", "senses.vision.height=16")
STEP_S = 0.04


def game_of(*overrides):
    return started.game_of("DodgeCar", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def walk(game, forward=0.0, turn=0.0):
    return game.step({"agents": np.array([forward, turn], np.float32)})


def hide(game):
    """Move the player out of the room."""
    game.task.walker.place((20.0, 20.0, 0.0))


def drive(game, steps):
    """Return positions and headings of the car without a player in the room."""
    hide(game)
    track = []
    for _ in range(steps):
        walk(game)
        track.append([*game.task.car.prop.position, game.task.car.heading_rad])
    return np.array(track)


@pytest.mark.parametrize("limit_kg", [0.5, 1.5, 5.0])
def test_a_player_that_stands_still_is_hit_whatever_it_can_push(limit_kg):
    game = game_of(f"body.push_limit_kg={limit_kg}")
    for seed in range(3):
        game.reset(np.random.default_rng(seed))
        assert any(walk(game).terminated for _ in range(500))
    game.close()


@pytest.mark.parametrize(
    ("task", "speed"),
    [("DodgeCar", "50"), ("ChaseCar", "50"), ("KickTheBall", "[50,60]")],
)
def test_a_speed_that_is_too_great_for_the_clock_is_refused_by_the_configuration(task, speed):
    words = [f"+task={task}", f"task.speed_mps={speed}"]
    with pytest.raises(ConfigError, match=naming("task.speed_mps", "m/s", "clock.substeps")):
        compose(words)
    compose([*words, "clock.substeps=40"])


# ---- the car


def loudness_of_ears(game, side_m):
    """Return the mean of each ear's spectrum after 10 steps beside a car at rest."""
    player = game.players[0]
    game.senses[player.name].update(
        make_senses(player.body, ["audio"], game.cfg.senses, game.world)
    )
    game.reset(np.random.default_rng(0))
    task = game.task
    task.walker.place((0.0, 0.0, 0.0))
    for _ in range(10):
        task.car.prop.place((0.0, side_m, 0.08))
        walk(game)
    return game.observe(player)["audio"][:2].mean(axis=-1)


@pytest.mark.parametrize("side_m", [1.0, -1.0])
def test_the_motor_is_heard_from_its_side(side_m):
    game = game_of()
    left, right = loudness_of_ears(game, side_m)
    assert np.sign(left - right) == np.sign(side_m)
    assert abs(left - right) > 0.05
    game.close()


def test_the_motor_can_be_silent():
    game = game_of("task.loudness=0")
    np.testing.assert_array_equal(loudness_of_ears(game, 1.0), -8.0)  # silence, log10
    game.close()


def test_a_negative_loudness_is_refused():
    with pytest.raises(ValueError, match=r"task\.loudness=-1"):
        game_of("task.loudness=-1")


def test_the_car_drives_round_the_room_at_its_speed():
    game = game_of("task.aim=0")
    tracks = []
    for seed in range(3):
        game.reset(np.random.default_rng(seed))
        tracks.append(drive(game, 300))
    speeds = [np.linalg.norm(np.diff(track[:, :2], axis=0), axis=1) / STEP_S for track in tracks]
    assert np.quantile(speeds, 0.6) == pytest.approx(1.5, abs=0.05)
    assert np.max(speeds) < 1.6
    track = np.concatenate(tracks)
    assert np.ptp(track[:, :2], axis=0).min() > 3.5
    # it turns before the walls at 3 m, which it can touch with the side
    assert np.quantile(np.abs(track[:, :2]).max(axis=1), 0.95) < 2.85
    np.testing.assert_allclose(track[:, 2], 0.08, atol=0.01)
    game.close()


def test_its_front_points_to_where_it_drives(game):
    game.reset(np.random.default_rng(3))
    track = drive(game, 200)
    way = np.diff(track[:, :2], axis=0)
    ahead = np.stack([np.cos(track[:-1, 3]), np.sin(track[:-1, 3])], axis=1)
    fast = np.linalg.norm(way, axis=1) > 0.04
    cosines = (way * ahead).sum(axis=1)[fast] / np.linalg.norm(way, axis=1)[fast]
    assert np.quantile(cosines, 0.05) > 0.98  # but while it slides along a wall


def test_it_keeps_away_from_furniture():
    game = game_of("playground=single_room", "task.aim=0")
    before = {name: prop.position for name, prop in game.world.props.items() if prop.fixed}
    driven_m = 0.0
    for seed in range(3):
        game.reset(np.random.default_rng(seed))
        track = drive(game, 250)
        driven_m += np.linalg.norm(np.diff(track[:, :2], axis=0), axis=1).sum()
        stool = game.world.props["stool"].position
        assert math.dist(stool[:2], (-2.4, 1.75)) < 0.02  # it was not pushed
    assert driven_m > 0.7 * 3 * 250 * STEP_S * 1.5
    assert all((game.world.props[name].position == place).all() for name, place in before.items())
    game.close()


def test_the_predicted_path_is_the_path_to_the_next_point(game):
    game.reset(np.random.default_rng(1))
    hide(game)
    walk(game)
    predicted = game.task.car.predicted_path(10)
    track = drive(game, 10)
    assert np.linalg.norm(track[:, :2] - predicted, axis=1).max() < 0.1


def test_a_car_that_lies_on_its_side_is_set_upright(game):
    game.reset(np.random.default_rng(0))
    hide(game)
    game.task.car.prop.set_velocity((0.0, 0.0, 1.5), (12.0, 0.0, 0.0))
    game.world.step()
    for _ in range(8):
        game.world.step()
    assert game.task.car.prop.rotation[2, 2] < 0.9
    walk(game)
    assert game.task.car.prop.rotation[2, 2] > 0.99


def test_the_same_seed_gives_the_same_drive(game):
    tracks = []
    for _ in range(2):
        game.reset(np.random.default_rng(5))
        tracks.append(drive(game, 100))
    np.testing.assert_array_equal(*tracks)


def test_an_episode_starts_without_the_point_of_the_last_one(game):
    game.reset(np.random.default_rng(5))
    drive(game, 10)
    game.reset(np.random.default_rng(6))
    car = game.task.car
    np.testing.assert_array_equal(car.point, car.prop.position[:2])
    np.testing.assert_array_equal(car.predicted_path(3), [car.point] * 3)


def test_it_drives_under_a_table_and_not_through_its_leg():
    game = game_of("playground=single_room")
    car, corner = game.task.car, np.array([-2.88, 2.88])
    assert car.fits_between(np.array([-1.5, 2.5]), np.array([-2.8, 2.5]))
    assert not car.fits_between(np.array([-1.5, 1.5]), corner)
    game.close()


def test_a_table_top_above_the_car_does_not_obstruct_it():
    """The first of two points, below the table, is as clear as the second one beside it."""
    game = game_of("playground=single_room")
    car, below, beside = game.task.car, np.array([-2.0, 2.6]), np.array([0.0, 2.6])
    car.prop.place((-1.2, 2.6, 0.08))
    points = iter((below, beside))
    car.drive(lambda rng: next(points), np.random.default_rng(0))
    np.testing.assert_array_equal(car.point, below)
    game.close()


# ---- where it aims


def aims_at(game, commands, place=(0.0, -2.0, 0.0)):
    """Return where the car drives after some steps of the player, which is far from it."""
    game.reset(np.random.default_rng(0))
    game.task.walker.place(place)
    game.task.car.prop.place((0.0, 2.7, 0.08), -math.pi / 2.0)
    for command in commands:
        walk(game, *command)
    return game.task.car.point


def test_it_drives_to_where_a_walking_player_will_be():
    game = game_of("task.aim=1")
    still = aims_at(game, [(0.0, 0.0)] * 20)
    np.testing.assert_allclose(still, (0.0, -2.0), atol=1e-6)
    x, y = aims_at(game, [(1.0, 0.0)] * 21, place=(-1.0, -2.0, 0.0))
    assert x > game.task.walker.position[0] + 1.0
    assert y == pytest.approx(-2.0, abs=0.01)
    game.close()


def test_it_drives_to_where_a_player_on_a_circle_will_be():
    game = game_of("task.aim=1")
    radius_m = 1.0 / math.radians(60.0)
    point = aims_at(game, [(1.0, 0.5)] * 31, place=(0.0, -2.0, 0.0))
    assert math.dist(point, (0.0, radius_m - 2.0)) == pytest.approx(radius_m, abs=0.08)
    assert math.dist(point, game.task.walker.position[:2]) > 0.5
    game.close()


def test_without_lead_it_drives_to_where_the_player_is():
    game = game_of("task.aim=1", "task.lead_s=0")
    point = aims_at(game, [(1.0, 0.0)] * 21)
    assert math.dist(point, game.task.walker.position[:2]) < 0.25
    game.close()


def test_near_the_player_it_drives_straight_on():
    game = game_of("task.aim=1")
    game.task.walker.place((0.0, 0.0, 0.0), math.pi / 2.0)
    game.task.car.prop.place((2.8, 0.0, 0.08), math.pi)
    while math.dist(game.task.car.prop.position[:2], game.task.walker.position[:2]) > 1.5:
        walk(game)
    point = game.task.car.point
    walk(game, 1.0)
    for _ in range(12):
        assert not walk(game, 1.0).done
        np.testing.assert_array_equal(game.task.car.point, point)
    game.close()


# ---- rules


def test_a_contact_ends_the_episode():
    game = game_of("task.aim=1")
    game.task.walker.place((0.0, 0.0, 0.0))
    game.task.car.prop.place((2.0, 0.0, 0.08), math.pi)
    outcomes = [walk(game)]
    while not outcomes[-1].done:
        outcomes.append(walk(game))
    *before, last = outcomes
    assert last.terminated
    assert last.terms["agents"] == {"hit": 1.0, "survived": 0.0}
    assert not game.task.solved(game.players[0])
    assert all(one.terms["agents"] == {"hit": 0.0, "survived": STEP_S} for one in before)
    assert 1.0 < len(outcomes) * STEP_S < 1.6  # 1.7 m at 1.5 m/s
    game.close()


def test_without_a_contact_the_task_is_solved():
    game = game_of("task.max_seconds=1")
    hide(game)
    outcomes = [walk(game) for _ in range(25)]
    assert outcomes[-1].truncated
    assert game.task.solved(game.players[0])
    game.close()


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("task.aim=1.5", ("task.aim=1.5", "[0, 1]")),
        ("task.speed_mps=0", ("task.speed_mps",)),
        ("task.speed_mps=50", ("task.speed_mps=50", "21.25 m/s", "clock.substeps")),
        ("task.lead_s=-1", ("task.lead_s=-1.0",)),
        ("playground=four_rooms", ("'four_rooms'", " 4 ", "playground=simple")),
        ("body=mitten", ("body=walker",)),
    ],
)
def test_what_cannot_be_played_is_refused(override, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        Game(compose(["+task=DodgeCar", override]).game)


# ---- policies


def episodes(game, policy, seeds, place=None):
    """Return the share of solved episodes and the mean return."""
    solved, total = 0, 0.0
    for seed in seeds:
        game.reset(np.random.default_rng(seed))
        if place is not None:
            game.task.walker.place(place)
        done = False
        while not done:
            game.play_script(game.players[0], policy)
            outcome = game.advance()
            total += game.reward_of(outcome.terms["agents"])
            done = outcome.done
        solved += bool(game.task.solved(game.players[0]))
    return solved / len(seeds), total / len(seeds)


def blind(game, command, seeds, place=None):
    """Return the share of solved episodes of a policy that knows only the number of the step."""
    solved = 0
    for seed in seeds:
        game.reset(np.random.default_rng(seed))
        if place is not None:
            game.task.walker.place(place)
        step, done = 0, False
        while not done:
            done = walk(game, *command(step)).done
            step += 1
        solved += bool(game.task.solved(game.players[0]))
    return solved / len(seeds)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(lambda step: (1.0, 1.0), id="circle of 0.5 m"),
        pytest.param(lambda step: (1.0, 0.5), id="circle of 1 m"),
        pytest.param(lambda step: (1.0, 0.3), id="circle of 1.6 m"),
        pytest.param(lambda step: (1.0, 0.2), id="circle of 2.4 m"),
        pytest.param(lambda step: (1.0, 0.0), id="straight on"),
        pytest.param(lambda step: (1.0 if step // 25 % 2 else -1.0, 0.0), id="forward and back"),
        pytest.param(lambda step: (1.0, 0.7 if step // 30 % 2 else -0.7), id="left and right"),
        pytest.param(lambda step: (float(step // 20 % 2), 0.6), id="stops on a circle"),
    ],
)
def test_motion_that_ignores_the_car_is_hit(game, command):
    assert blind(game, command, range(20)) <= 0.35


# a walker of 0.11 m touches the piece, or stands in a corner that furniture shields
BESIDE = {
    "bed": (1.93, -0.6, 0.0),
    "bed and wall": (2.87, 0.42, 0.0),
    "wardrobe": (2.33, 1.6, 0.0),
    "wardrobe and wall": (2.87, 2.23, 0.0),
    "shelf": (-2.53, 1.2, 0.0),
    "sofa": (-2.13, -1.0, 0.0),
    "sofa and wall": (-2.87, -0.18, 0.0),
    "table": (-1.78, 2.3, 0.0),
    "corner behind the table": (-2.88, 2.88, 0.0),
    "between table and shelf": (-2.87, 1.93, 0.0),
    "stool": (-2.12, 1.75, 0.0),
    "corner behind the lamp": (2.88, -2.88, 0.0),
    "plant pot": (-2.5, -2.5, 0.0),
}


@pytest.mark.slow
def test_standing_beside_furniture_is_hit():
    game = game_of("playground=single_room")
    solved = {
        name: blind(game, lambda _: (0.0, 0.0), range(4), place) for name, place in BESIDE.items()
    }
    assert max(solved.values()) <= 0.25, solved
    assert np.mean(list(solved.values())) <= 0.1, solved
    game.close()


@pytest.mark.parametrize("place", [None, (-2.85, -2.85, 0.0)])
def test_standing_still_is_hit_also_in_a_corner(game, place):
    solved, mean = episodes(game, Script.idle, range(8), place)
    assert solved <= 0.13
    assert mean < -0.3


@pytest.mark.slow
def test_the_expert_dodges():
    game = game_of("task.max_seconds=10")
    solved, mean = episodes(game, Script.expert, range(100, 108))
    assert solved >= 0.6
    assert mean == pytest.approx(0.5 * solved - (1.0 - solved), abs=0.2)
    game.close()


def is_hit(game, seed):
    """Return whether the car hits the expert near which it draws another point."""
    game.reset(np.random.default_rng(seed))
    game.task.walker.place((1.28, -1.02, 0.0), math.radians(76.0))
    game.task.car.prop.place((0.51, -1.16, 0.08), math.radians(20.0))
    game.task.car.drive_to(np.array([0.93, -1.0]))
    for _ in range(45):
        game.play_script(game.players[0], Script.expert)
        if game.advance().done:
            return True
    return False


@pytest.mark.slow
def test_the_expert_expects_the_car_to_draw_another_point_near_it(game):
    assert sum(is_hit(game, seed) for seed in range(40)) <= 3


@pytest.mark.slow
def test_the_expert_dodges_in_most_episodes(game):
    solved, _ = episodes(game, Script.expert, range(200, 230))
    assert solved >= 0.9
