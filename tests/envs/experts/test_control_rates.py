"""Experts whose motion is given per second: other control rates, and those that are refused."""

import numpy as np
import pytest
from blocks import blocks_game, play
from refusals import naming

from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion

ASIDE = Grip(np.array([0.25, 0.2, 0.2]), 0.1)
# the default clock, and twice its control rate with physics steps of nearly the same duration
CLOCKS = {25: (), 50: ("clock.control_rate_hz=50", "clock.substeps=3")}
FOUR_TIMES = ("clock.control_rate_hz=98", "clock.substeps=2")


def middle_after(rate_hz, seconds):
    """Return where the middle of palms is that have moved aside for some time, metres."""
    game = blocks_game("GrabObject", *CLOCKS[rate_hz])
    game.reset(np.random.default_rng(0))
    game.task.toy.place((1.5, 1.5, 0.05))
    player = game.players[0]
    palms = PalmMotion(player.body, game.world.clock.step_s)
    for targets in palms.during(ASIDE, seconds):
        game.step({player.name: player.body.encode(targets)})
    moved, steps = palms.middle, game.steps
    game.close()
    assert steps == round(seconds * rate_hz)
    return moved


def test_palms_move_at_the_same_speed_at_twice_the_control_rate():
    slow, fast = middle_after(25, 0.48), middle_after(50, 0.48)
    np.testing.assert_allclose(fast, slow, atol=0.02)


def turned_rad(rate_hz):
    """Return by how much the expert turns its target angles in a second, (82,)."""
    game = blocks_game("RotateCube", *CLOCKS[rate_hz])
    game.reset(np.random.default_rng(0))
    expert = game.expert_of(game.players[0])
    start = expert._angles.copy()
    for _ in range(rate_hz):  # the cube is not simulated: its error stays
        targets = expert.act({})
    game.close()
    return targets - start


def test_a_hand_turns_at_the_same_speed_at_twice_the_control_rate():
    slow, fast = turned_rad(25), turned_rad(50)
    assert np.abs(slow).max() > 0.3
    np.testing.assert_allclose(fast, slow, rtol=1e-9)


@pytest.mark.slow  # 490 to 1180 agent steps, each with its inverse kinematics
@pytest.mark.parametrize("task", ["GrabObject", "PutDownBlock"])
def test_experts_that_carry_solve_their_task_at_four_times_the_control_rate(task):
    game = blocks_game(task, *FOUR_TIMES)
    assert play(game, seed=0)[1]
    game.close()


@pytest.mark.parametrize("task", ["GrabObject", "RotateCube"])
@pytest.mark.parametrize("rate_hz", [10, 18, 294])
def test_experts_that_hold_things_are_refused_at_control_rates_at_which_they_fail(task, rate_hz):
    substeps = max(1, 150 // rate_hz)
    clock = (f"clock.control_rate_hz={rate_hz}", f"clock.substeps={substeps}")
    game = blocks_game(task, *clock)
    named = naming(f"{task}Expert", "clock.control_rate_hz", " 21 ", " 245", f" {rate_hz}")
    with pytest.raises(ValueError, match=named):
        game.expert_of(game.players[0])
    game.close()
