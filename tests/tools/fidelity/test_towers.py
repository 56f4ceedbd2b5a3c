"""Towers of cubes stand for a minute with the preset for stacking."""

import math

import pytest
from composed import compose

from tools.fidelity.mechanics.towers import STACKING, TOWERS_KG, laws, stand


def test_the_laws_are_those_of_the_preset():
    assert compose(["+task=KickTheBall", "clock=stacking"]).clock == STACKING


@pytest.mark.parametrize("name", ["two cubes", "2 kg on 0.2 kg"])
def test_small_towers_stand_for_a_minute_without_creeping(name):
    assert not [law for law in laws(name) if not law.holds]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, *range(4)])
@pytest.mark.parametrize("name", TOWERS_KG)
def test_towers_stand_for_a_minute_without_creeping(name, seed):
    moved = stand(STACKING, TOWERS_KG[name], seed)
    assert moved.creep_m < 1e-3
    assert moved.settling_m < 0.01


@pytest.mark.slow
def test_without_sleep_a_tower_of_five_stands_as_well():
    clock = type(STACKING)(STACKING.control_rate_hz, STACKING.substeps, 100, sleep_s=math.inf)
    assert stand(clock, TOWERS_KG["five cubes"]).settling_m < 0.01
