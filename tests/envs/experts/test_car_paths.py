"""Predicted paths of the toy car are those that it drives."""

import numpy as np
import pytest
import started

from veca_marl.envs.experts.cars import car_paths, room_points

STEP_S = 0.04


@pytest.fixture(scope="module")
def game():
    game = started.game_of("DodgeCar", "senses.vision.width=16", "senses.vision.height=16")
    game.task.walker.place((20.0, 20.0, 0.0))
    yield game
    game.close()


def drive(game, point, steps):
    """Return the places of the car after each step towards a point, ``(steps, 2)``."""
    rng, places = np.random.default_rng(0), []
    for _ in range(steps):
        game.task.car.drive_to(point)
        game.task.car.drive(lambda _: point, rng)
        game.world.step()
        places.append(game.task.car.prop.position[:2])
    return np.array(places)


def test_a_car_that_does_not_arrive_has_one_path(game):
    car, point = game.task.car, np.array([2.0, 1.0])
    car.prop.place((-2.0, -1.0, 0.08), 1.5)
    car.drive_to(point)
    car.drive(lambda _: point, np.random.default_rng(0))
    game.world.step()
    predicted = car_paths(car, room_points(car, 2), 30, STEP_S)
    assert predicted.shape == (1, 30, 2)
    np.testing.assert_allclose(predicted[0], car.predicted_path(30), atol=1e-9)
    np.testing.assert_allclose(predicted[0], drive(game, point, 30), atol=0.1)


def test_a_car_that_arrives_drives_on_to_each_point(game):
    car, point, nexts = game.task.car, np.array([0.0, 0.0]), np.array([[0.0, 2.0], [-1.5, -1.5]])
    for number, after in enumerate(nexts):
        car.reset((-0.6, 0.0), np.random.default_rng(0))
        car.prop.place((-0.6, 0.0, 0.08), 0.0)
        drive(game, point, 2)
        predicted = car_paths(car, nexts, 40, STEP_S)
        assert predicted.shape == (2, 40, 2)
        before = drive(
            game,
            point,
            next(step for step, place in enumerate(predicted[0]) if np.linalg.norm(place) < 0.15)
            + 1,
        )
        driven = np.concatenate([before, drive(game, after, 40 - len(before))])
        assert np.linalg.norm(predicted[number] - driven, axis=1).max() < 0.15
        assert np.linalg.norm(predicted[number][-1] - after) < np.linalg.norm(point - after)


def test_the_points_are_spread_over_the_room(game):
    points = room_points(game.task.car, 3)
    assert points.shape == (9, 2)
    np.testing.assert_allclose(points.mean(axis=0), game.task.car.room.middle_m[:2], atol=1e-9)
    np.testing.assert_allclose(np.ptp(points, axis=0), 4.0)
