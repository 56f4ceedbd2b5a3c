"""WallRecovery: who gets nowhere goes back for a while, and nobody else does."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from veca_marl.envs.experts.control.wall_recovery import WallRecovery
from veca_marl.sim.sound import Call

STEP_S = 0.04


class Said:
    """Locomotion that say what they were asked."""

    clearances = None

    def to(self, place, call):
        return "to", call

    def turn(self, left, call):
        return "turn", call

    def rest(self, call):
        return "rest", call

    def back(self, call):
        return "back", call


def asked(seconds, speed_mps=0.0, turn_rad_s=0.0, what="to", call=Call.none):
    """Ask again and again while a body goes and turns so fast; return what the legs were told."""
    body = SimpleNamespace(position=np.zeros(3), forward=np.array([1.0, 0.0, 0.0]))
    legs, told = WallRecovery(body, Said(), STEP_S), []
    for step in range(round(seconds / STEP_S)):
        time_s = step * STEP_S
        body.position = np.array([speed_mps * time_s, 0.0, 0.0])
        angle = turn_rad_s * time_s
        body.forward = np.array([math.cos(angle), math.sin(angle), 0.0])
        goal = {"to": (np.ones(2),), "turn": (1.0,), "rest": ()}[what]
        told.append(getattr(legs, what)(*goal, call))
    return told


@pytest.mark.parametrize("what", ["to", "turn"])
def test_who_gets_nowhere_goes_back_and_then_tries_again(what):
    told = [word for word, _ in asked(5.6, what=what)]
    held, back = 35, 30
    assert told[:held] == [what] * held
    assert told[held : held + back] == ["back"] * back
    assert told[held + back : 2 * held + back] == [what] * held
    assert told[2 * held + back] == "back"


@pytest.mark.parametrize("moves", [{"speed_mps": 0.15}, {"turn_rad_s": 0.5}])
def test_who_gets_on_or_round_does_not(moves):
    assert {word for word, _ in asked(6.0, **moves)} == {"to"}


def test_who_rests_does_not():
    assert {word for word, _ in asked(6.0, what="rest")} == {"rest"}


def test_calls_go_on():
    assert {call for _, call in asked(3.0, call=Call.high)} == {Call.high}
