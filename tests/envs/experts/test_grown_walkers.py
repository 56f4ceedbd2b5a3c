"""Experts of tasks of walkers with bodies of several ages."""

import pytest
from composed import compose
from rollouts import returns

from veca_marl.envs.core.game_cfg import Script

# tasks in which the expert reaches the goal in every episode, and its return in each of them
REACHED = {
    "MazeNav": 5.0,
    "ChaseCar": 3.0,
    "ShapeSort": 6.0,
    "ColorSort": 6.0,
    "FillFraction": 6.0,
}
EPISODES = 2


def game(task, age, *overrides):
    return compose([f"+task={task}", f"development={age}", *overrides]).game


@pytest.mark.slow  # whole episodes
@pytest.mark.parametrize("age", [4, 8, 18])
@pytest.mark.parametrize(("task", "whole"), REACHED.items())
def test_the_expert_reaches_the_goal_at_every_age(task, whole, age):
    assert returns(game(task, age), EPISODES, Script.expert).mean() > 0.8 * whole


@pytest.mark.slow
@pytest.mark.parametrize("age", [4, 8, 18])
@pytest.mark.parametrize("task", ["KickTheBall", "MultiAgentNav"])
def test_the_expert_is_better_than_chance_at_every_age(task, age):
    expert = returns(game(task, age), 3, Script.expert)
    random = returns(game(task, age), 6, Script.random)
    assert expert.mean() > random.mean() + 1.0


@pytest.mark.slow
@pytest.mark.parametrize("age", [8, 18])
def test_a_child_that_sees_into_the_drawer_takes_the_key(age):
    assert returns(game("BabyzumasRevenge", age), EPISODES, Script.expert).mean() > 0.4
