"""WallRecovery: only a stuck body moves backwards."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.sim.sound import Call

STEP_S = 0.04
AHEAD, BEHIND = np.array([1.0, 1.0]), np.array([-1.0, 0.0])


class Recorder:
    """Locomotion that returns the name of the called method."""

    clearances = None

    def to(self, place, call):
        return "to", call

    def turn(self, left, call):
        return "turn", call

    def rest(self, call):
        return "rest", call

    def back(self, call):
        return "back", call


def simulate(
    seconds, speed_mps=0.0, turn_rad_s=0.0, what="to", call=Call.none, turning_s=0.0, place=AHEAD
):
    """Call a method at every step while a body moves; return what reaches the locomotion."""
    body = SimpleNamespace(position=np.zeros(3), forward=np.array([1.0, 0.0, 0.0]))
    locomotion, calls = WallRecovery(body, Recorder(), STEP_S, turning_s), []
    for step in range(round(seconds / STEP_S)):
        time_s = step * STEP_S
        body.position = np.array([speed_mps * time_s, 0.0, 0.0])
        angle = turn_rad_s * time_s
        body.forward = np.array([math.cos(angle), math.sin(angle), 0.0])
        goal = {"to": (place,), "turn": (1.0,), "rest": ()}[what]
        calls.append(getattr(locomotion, what)(*goal, call))
    return calls


@pytest.mark.parametrize("what", ["to", "turn"])
def test_a_stuck_body_moves_backwards_and_tries_again(what):
    calls = [word for word, _ in simulate(5.6, what=what)]
    held, back = 35, 30
    assert calls[:held] == [what] * held
    assert calls[held : held + back] == ["back"] * back
    assert calls[held + back : 2 * held + back] == [what] * held
    assert calls[2 * held + back] == "back"


@pytest.mark.parametrize("moves", [{"speed_mps": 0.15}, {"turn_rad_s": 0.5}])
def test_a_moving_or_turning_body_is_not_stuck(moves):
    assert {word for word, _ in simulate(6.0, **moves)} == {"to"}


def test_a_body_with_a_place_behind_it_has_time_to_turn():
    for turning_s, place, begins_s in ((2.8, BEHIND, 4.16), (2.8, AHEAD, 1.4), (0.0, BEHIND, 1.4)):
        calls = [word for word, _ in simulate(5.0, turning_s=turning_s, place=place)]
        assert calls.index("back") == pytest.approx(begins_s / STEP_S, abs=1.5)


def test_a_resting_body_is_not_stuck():
    assert {word for word, _ in simulate(6.0, what="rest")} == {"rest"}


def test_calls_are_passed_on():
    assert {call for _, call in simulate(3.0, call=Call.high)} == {Call.high}
