"""Experts go round furniture, and straight where nothing is in the way."""

import math

import numpy as np
import pytest
from seeking import walker_at

from veca_marl.envs.experts.control.locomotion import walk_to
from veca_marl.envs.experts.control.path_following import FurnitureDetours, StraightWays, detours_in
from veca_marl.sim.physics import (
    FurnitureCfg,
    FurnitureKind,
    PlaygroundCfg,
    RoomCfg,
    WallsCfg,
    World,
)

SOFA = FurnitureCfg("sofa", FurnitureKind.sofa, (0.0, 0.0), 90.0)  # 0.75 m along x, 1.6 m along y
START, GOAL = np.array([-1.5, 0.2]), np.array([1.5, 0.0])


@pytest.fixture
def world():
    room = RoomCfg(lower_m=(-2.5, -2.0, 0.0), size_m=(5.0, 4.0, 2.6))
    world = World(PlaygroundCfg(name="den", rooms=[room], walls=WallsCfg(), furniture=[SOFA]))
    yield world
    world.close()


def test_a_walker_goes_round_a_sofa(world):
    walker, detours = walker_at(world, *START), detours_in(world, clear_m=0.2)
    for _ in range(25 * 8):
        point = detours.next_point(walker.position, GOAL)
        walker.act(walker.encode(walk_to(walker, point)))
        world.step()
        if math.dist(walker.position[:2], GOAL) < 0.2:
            break
    assert math.dist(walker.position[:2], GOAL) < 0.2


def test_a_way_without_furniture_is_straight(world):
    detours = FurnitureDetours(world, clear_m=0.2)
    beside = np.array([-1.5, 1.2])
    np.testing.assert_array_equal(detours.next_point(START, beside), beside)
    around = detours.next_point(START, GOAL)
    assert abs(around[1]) > 0.3, "towards an end of the sofa"


def test_unfurnished_playgrounds_have_straight_ways():
    world = World(PlaygroundCfg(name="bare"))
    assert isinstance(detours_in(world, 0.2), StraightWays)
    world.close()
