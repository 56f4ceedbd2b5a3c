"""Tasks that are spread over rooms refuse houses with rooms that cannot be reached."""

from dataclasses import replace

import pytest
from refusals import naming
from rollouts import game_cfg
from seeking import shipped

from veca_marl.envs.tasks.floors.playability import check_connected
from veca_marl.sim.physics import JointKind, LeafCfg, PlaygroundCfg, RoomCfg

SPREAD = ["ObjectNav", "ObjectPhysNav", "MultiAgentNav", "ColorSort", "ShapeSort", "FillFraction"]
SHUT = LeafCfg(opening=0.0, locked=True)


def with_leaves(leaf, playground="house"):
    """A shipped house with the same leaf in all doors."""
    house = shipped(playground)
    return replace(house, doors=[replace(door, leaf=leaf) for door in house.doors])


@pytest.mark.parametrize("task", SPREAD)
def test_rooms_that_no_door_leads_to_are_refused_by_name(task):
    game = game_cfg(task)
    for place in (with_leaves(SHUT), replace(shipped("house"), doors=[])):
        beyond = "['kitchen', 'nursery', 'bedroom']"
        parts = (task, "'house'", "'living'", beyond, "playground.doors", "playground=house")
        with pytest.raises(ValueError, match=naming(*parts)):
            replace(game, playground=place).check_playground()
    replace(game, playground=shipped("house")).check_playground()


def test_the_doors_that_are_locked_are_named():
    house = shipped("house")
    first, *others = house.doors
    check_connected("Task", replace(house, doors=[replace(first, leaf=SHUT), *others]), house.rooms)
    shut = [replace(first, leaf=SHUT), replace(others[-1], leaf=SHUT), *others[:-1]]
    named = naming("leaf.locked=false", "['door_bedroom', 'door_kitchen']")
    with pytest.raises(ValueError, match=named):
        check_connected("Task", replace(house, doors=shut), house.rooms)
    check_connected("Task", replace(house, doors=shut), house.rooms[1:])


@pytest.mark.parametrize(
    "leaf",
    [
        LeafCfg(opening=0.0),
        LeafCfg(opening=1.0, locked=True),
        LeafCfg(opening=0.0, locked=True, key="block_red"),
        LeafCfg(opening=0.5, locked=True),
    ],
    ids=["pushed", "locked open", "key", "ajar"],
)
def test_doors_that_bodies_may_pass_connect(leaf):
    house = with_leaves(leaf)
    check_connected("Task", house, house.rooms)


def test_a_sliding_leaf_that_is_locked_ajar_is_shut():
    house = shipped("house2")
    door = next(each for each in house.doors if each.leaf and each.leaf.kind is JointKind.slide)
    ajar = replace(door, leaf=replace(door.leaf, opening=0.2, locked=True))
    bedroom = next(each for each in house.doors if each.name == "door_bedroom")
    with pytest.raises(ValueError, match=naming("'house2'", door.name)):
        check_connected("Task", replace(house, doors=[ajar, bedroom]), house.rooms)


def test_rooms_that_touch_without_walls_are_connected():
    rooms = [RoomCfg("west"), RoomCfg("east", lower_m=(3.0, -3.0, 0.0))]
    check_connected("Task", PlaygroundCfg("open", rooms), rooms)
    corner = [rooms[0], replace(rooms[1], lower_m=(3.0, 3.0, 0.0))]
    with pytest.raises(ValueError, match=naming("'corner'", "'west'", "['east']")):
        check_connected("Task", PlaygroundCfg("corner", corner), corner)
