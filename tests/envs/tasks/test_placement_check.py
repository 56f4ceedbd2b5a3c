"""What a task places at random must fit into its playground, or the configuration is refused."""

import math

import numpy as np
import pytest
from composed import compose
from refusals import naming
from seeking import shipped

from veca_marl.config import ConfigError
from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.floors.places import (
    free_pair,
    furniture_of,
    planned_furniture,
    rooms_with_pairs,
)
from veca_marl.envs.tasks.floors.playability import TRIALS, check_placement
from veca_marl.sim.physics import JointCfg, JointKind, PlannedProp, PropCfg, PropShape, World

TINY_ROOMS = (
    "playground.rooms=[{name: a, lower_m: [0,0,0], size_m: [1.1,1.1,2.6]},"
    "{name: b, lower_m: [1.2,0,0], size_m: [1.1,1.1,2.6]}]",
    "playground.doors=[{name: d, rooms: [a,b], position_m: [1.15,0.55], width_m: 0.5}]",
    "playground.props=[]",
)
CLEAR_M, APART_M = 0.8, 1.0  # of MultiAgentNav


@pytest.mark.parametrize(
    ("task", "overrides", "parts"),
    [
        ("ObjectNav", ["task.apart_m=9"], ("task.apart_m=9", "'simple'", "6 x 6 m")),
        (
            "ObjectNav",
            ["task.reach_m=5", "task.apart_m=6"],
            ("task.reach_m=5", "5.40 m", "playground=house"),
        ),
        ("ObjectNav", [f"task.objects=[ball{18 * ',cube'}]"], ("19 task.objects", " 20 ")),
        ("ObjectPhysNav", ["task.apart_m=7"], ("ObjectPhysNav", "task.apart_m=7")),
        ("MultiAgentNav", ["task.radius_m=3"], ("task.radius_m=3", "hall 9.2")),
        ("ColorSort", ["task.items=8"], ("24 ", "task.items=8", "3 baskets")),
        ("ShapeSort", ["task.apart_m=4"], ("ShapeSort", "6 toys", "task.apart_m=4")),
        ("FillFraction", ["task.apart_m=3"], ("task.circles=3", "8 task.pieces", "task.apart_m=3")),
        ("DodgeCar", ["task.apart_m=12"], ("DodgeCar", "task.apart_m=12")),
        ("ChaseCar", ["task.apart_m=12"], ("ChaseCar", "task.apart_m=12")),
        ("BabyzumasRevenge", TINY_ROOMS, ("'a'", "1.1 x 1.1 m", "cupboard")),
    ],
)
def test_what_does_not_fit_is_refused_by_the_configuration(task, overrides, parts):
    with pytest.raises(ConfigError, match=naming(*parts)):
        compose([f"+task={task}", *overrides])


def test_a_placement_that_fails_now_and_then_is_refused():
    """A single trial passed, and some reset failed later."""
    with pytest.raises(ConfigError, match=naming("ObjectNav", "task.apart_m=4.4")):
        compose(["+task=ObjectNav", "task.objects=[ball,cube]", "task.apart_m=4.4"])
    seen = []

    def place(rng):
        seen.append(rng.random())
        if len(seen) == TRIALS:
            raise ValueError("full")

    with pytest.raises(ValueError, match=naming("a sack", "full", "another")):
        check_placement(place, "a sack", "another")
    assert len(set(seen)) == TRIALS == 20


@pytest.mark.parametrize("playground", ["single_room", "house2"])
def test_planned_furniture_stands_where_that_of_a_world_stands(playground):
    """With the doors at their opening at the start."""
    world = World(shipped(playground))
    built, planned = furniture_of(world), planned_furniture(world.playground)
    assert len(built) == len(planned) > 10
    for one, other in zip(built, planned, strict=True):
        np.testing.assert_allclose(other.position, one.position, atol=1e-12)
        np.testing.assert_allclose(other.rotation, one.rotation, atol=1e-12)
        assert (other.radius_m, other.reach_m) == (one.radius_m, one.reach_m)
        assert other.fixed == one.fixed
    world.close()


@pytest.mark.parametrize(
    "joint",
    [
        JointCfg(JointKind.hinge, axis=(0.0, 0.5, -2.0), anchor_m=(0.3, -0.1, 0.2), opening=0.7),
        JointCfg(JointKind.slide, axis=(1.0, 2.0, 0.0), opening=0.4),
    ],
)
def test_planned_props_open_as_those_of_a_world_do(joint):
    size_m, turned = [0.4, 0.3, 0.2], {"position_m": (1.0, -2.0, 0.5), "yaw_deg": 40.0}
    cfg = PropCfg("flap", PropShape.box, size_m, mass_kg=1.0, joint=joint, **turned)
    world = World(shipped("simple"))
    built, planned = world.add_prop(cfg), PlannedProp(cfg)
    np.testing.assert_allclose(planned.position, built.position, atol=1e-6)
    np.testing.assert_allclose(planned.rotation, built.rotation, atol=1e-6)
    world.close()


# ---- the room of the object in MultiAgentNav


def test_rooms_without_floor_for_a_pair_are_left_out_and_the_others_have_one():
    """In the bedroom of house2 the object has no place beside an agent."""
    playground, rng = shipped("house2"), np.random.default_rng(1)
    rooms, furniture = rooms_with_pairs(playground, CLEAR_M, APART_M), planned_furniture(playground)
    assert {room.name for room in playground.rooms} - {room.name for room in rooms} == {"bedroom"}
    for room in rooms:
        one, other = free_pair(room, furniture, CLEAR_M, APART_M, rng)
        assert math.dist(one, other) >= APART_M


@pytest.mark.slow
def test_multi_agent_nav_starts_in_a_house_with_a_full_room():
    """12 of these 60 starts failed: the object was to lie in the bedroom or the study."""
    small = ("senses.vision.width=8", "senses.vision.height=8", "senses.audio.present=false")
    game = Game(compose(["+task=MultiAgentNav", "playground=house2", *small]).game)
    rooms = {room.name: room for room in game.world.playground.rooms}
    for seed in range(60):
        game.reset(np.random.default_rng(seed))
        assert not rooms["bedroom"].contains(game.task.target.position)
    game.close()
