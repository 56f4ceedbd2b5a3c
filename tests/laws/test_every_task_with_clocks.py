"""The objective of a task does not depend on the rate of its actions."""

import numpy as np
import pytest
from refusals import naming
from rollouts import game_cfg

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS

RATED = sorted(
    name
    for name, task in TASKS.items()
    if task.rates and task.__module__.startswith("veca_marl.envs.tasks.")
)
# the first one in the quick suite
each_rated = pytest.mark.parametrize(
    "name", [RATED[0], *(pytest.param(name, marks=pytest.mark.slow) for name in RATED[1:])]
)


def game_at(task, rate_hz, *overrides):
    """Return a game at a rate of actions, with physics steps of 6.7 ms."""
    clock = [f"clock.control_rate_hz={rate_hz}", f"clock.substeps={150 // rate_hz}"]
    return Game(game_cfg(task, "own", *clock, *overrides))


@each_rated
def test_weights_of_rates_are_proportional_to_the_duration_of_a_step(name):
    rates, given = TASKS[name].rates, game_cfg(name).task.weights
    for rate_hz in (25, 50):
        game = game_at(name, rate_hz)
        assert game.cfg.task.weights == given
        for term, weight in game.weights.items():
            per_step = given[term] * 25.0 / rate_hz if term in rates else given[term]
            assert weight == pytest.approx(per_step, rel=1e-12)
        game.close()


@each_rated
def test_at_the_default_clock_weights_are_those_of_the_configuration(name):
    game = Game(game_cfg(name))
    assert game.weights == game.cfg.task.weights
    game.close()


def walked(rate_hz):
    """Walk ahead for two seconds in KickTheBall; return the return and the sum of `approach`."""
    game = game_at("KickTheBall", rate_hz, "task.max_seconds=2")
    game.reset(Episodes(0).next())
    returns = approach = 0.0
    for _ in range(game.max_steps):
        terms = game.step({"agents": np.array([1.0, 0.0], np.float32)}).terms["agents"]
        returns += game.reward_of(terms)
        approach += terms["approach"]
    game.close()
    return returns, approach


def test_the_return_of_a_walk_does_not_depend_on_the_rate():
    (slow, slow_approach), (fast, fast_approach) = walked(25), walked(50)
    assert abs(slow_approach) > 1.0
    assert fast_approach == pytest.approx(2.0 * slow_approach, rel=0.1)
    assert fast == pytest.approx(slow, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["default", "agent4ms"])
def test_tearing_the_tower_down_is_worse_than_doing_nothing_with_every_clock(clock):
    game = Game(game_cfg("PutDownBlock", "own", f"clock={clock}"))
    game.reset(Episodes(0).next())
    idle = game.reward_of(game.task.reward(game.players[0])) * game.max_steps
    game.task._newly_fallen = 1
    torn = game.reward_of(game.task.reward(game.players[0]) | {"height": 0.0})
    game.close()
    assert torn < 1.2 * idle < -20.0


def test_a_rate_that_is_no_term_is_refused(monkeypatch):
    monkeypatch.setattr(TASKS["TurnBaby"], "rates", ("torso", "speed"))
    with pytest.raises(ValueError, match=naming("TurnBaby.rates", "['speed']", "'hip'", "'torso'")):
        Game(game_cfg("TurnBaby"))
