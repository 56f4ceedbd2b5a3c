"""What is taken away from a generated house: what closes a position off, or meets a leaf."""

import numpy as np
import pytest

from veca_marl.sim.physics import RandomHouseCfg
from veca_marl.sim.physics.houses.furniture import FURNITURE, FurnitureCfg, FurnitureKind
from veca_marl.sim.physics.houses.generated_doors import floor_of, in_front, turns_into
from veca_marl.sim.physics.houses.house_repair import (
    WITH_LEAVES,
    HouseData,
    WalkerLaw,
    repaired,
)
from veca_marl.sim.physics.houses.walls import WallsCfg
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

WALLS = WallsCfg()
ROOM = RoomCfg("den", (0.0, 0.0, 0.0), (4.0, 3.0, 2.6))


def piece(name, kind, x, y, yaw_deg=0.0):
    return FurnitureCfg(name, kind, (x, y), yaw_deg)


def data_of(house):
    return HouseData(house.rooms, house.doors, house.furniture)


def names(house):
    return [each.name for each in house.furniture]


@pytest.mark.parametrize("leaves", [0.0, 1.0])
def test_nothing_is_taken_from_a_house_that_is_valid(leaves):
    for seed in np.random.default_rng(0).integers(0, 1_000_000, 5).tolist():
        house = data_of(RandomHouseCfg(seed=seed, leaves=leaves))
        assert repaired(house, WALLS) == house


def corner_behind(gap_m):
    """A corner of 0.6 m x 1 m between a wardrobe, a fridge and walls, open by a gap."""
    wardrobe, fridge = FURNITURE[FurnitureKind.wardrobe], FURNITURE[FurnitureKind.fridge]
    first = piece("first", FurnitureKind.wardrobe, 0.6 + wardrobe.depth_m / 2, 0.5, 90.0)
    second = piece("second", FurnitureKind.fridge, 0.3, 1.0 + gap_m + fridge.depth_m / 2)
    far = piece("far", FurnitureKind.stool, 3.8, 2.8)
    return HouseData([ROOM], [], [first, second, far])


def test_the_last_piece_that_closes_a_position_off_is_taken_away():
    assert names(repaired(corner_behind(gap_m=0.1), WALLS)) == ["first", "far"]


def test_a_gap_that_a_walker_passes_is_left():
    house = corner_behind(gap_m=0.4)
    assert repaired(house, WALLS) == house


def test_an_area_that_several_pieces_close_off_is_opened_too():
    """Two shelves, one behind the other, that go from wall to wall."""
    narrow = RoomCfg("corridor", (0.0, 0.0, 0.0), (4.0, 1.3, 2.6))
    shelves = [piece(f"shelf_{x}", FurnitureKind.shelf, x, 0.65, 90.0) for x in (1.5, 1.9)]
    left = repaired(HouseData([narrow], [], shelves), WALLS)
    assert left.furniture == []


def test_a_piece_that_a_leaf_meets_is_taken_away_and_the_leaf_stays():
    for seed in np.random.default_rng(1).integers(0, 1_000_000, 3).tolist():
        house = data_of(RandomHouseCfg(seed=seed, leaves=1.0))
        room, door = next(
            (room, door)
            for door in house.doors
            for room in house.rooms
            if door.leaf is not None
            and room.name in door.rooms
            and turns_into(floor_of(room), door)
        )
        low, size = in_front(floor_of(room), door, door.width_m)
        x, y = np.add(low, np.divide(size, 2.0)).tolist()
        blocked = house._replace(
            furniture=[*house.furniture, piece("obstacle", FurnitureKind.stool, x, y)]
        )
        assert repaired(blocked, WALLS) == house


def test_walls_that_close_a_room_off_are_refused():
    rooms = [ROOM, RoomCfg("hall", (4.1, 0.0, 0.0), (4.0, 3.0, 2.6))]
    narrow = DoorCfg("door", ("den", "hall"), (4.05, 1.5), 0.15)
    with pytest.raises(ValueError, match="door_width_m"):
        repaired(HouseData(rooms, [narrow], []), WALLS)


@pytest.mark.parametrize("law", [WalkerLaw(), WITH_LEAVES], ids=["plain", "leaves"])
def test_some_points_without_space_may_be_closed_off(law):
    """Points behind a wall: none of them has space round it, then one has."""
    clearance_m = np.full((20, 20), 1.0)
    clearance_m[:, 10:] = 0.0
    clearance_m[:6, 12] = 0.12
    assert not law.closed_off(clearance_m, most=6).any()
    assert law.closed_off(clearance_m, most=5).sum() == 6
    clearance_m[0, 12] = law.space_m
    assert law.closed_off(clearance_m, most=6).sum() == 6
