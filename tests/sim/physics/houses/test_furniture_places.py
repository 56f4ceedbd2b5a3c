"""Furniture stands in a room, apart from other furniture and doors, or is refused."""

from dataclasses import replace

import pytest
from refusals import naming

from veca_marl.sim.physics import (
    DoorCfg,
    FurnitureCfg,
    FurnitureKind,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    RoomCfg,
    WallsCfg,
)

ROOMS = [
    RoomCfg("west", (0.0, 0.0, 0.0), (4.0, 4.0, 2.6)),
    RoomCfg("east", (4.1, 0.0, 0.0), (4.0, 4.0, 2.6)),
]
DOOR = DoorCfg("door", ("west", "east"), (4.05, 2.0), 1.0)


def piece(kind, x, y, yaw_deg=0.0, name=""):
    return FurnitureCfg(name or kind, FurnitureKind[kind], (x, y), yaw_deg)


def house(*furniture, **numbers):
    return PlaygroundCfg(
        "house", ROOMS, [DOOR], furniture=list(furniture), **{"walls": WallsCfg(), **numbers}
    )


@pytest.mark.parametrize(
    ("outside", "nearest"),
    [
        (piece("bed", 100.0, 1.0), "east"),
        (piece("bed", 4.05, 3.0), "west"),  # across the wall between the rooms
        (piece("bed", 0.4, 3.5), "west"),  # 0.55 m of it in the outer wall
        (piece("lamp", 0.1, 3.0), "west"),  # its shade
        (piece("table", 0.55, 1.0, 45.0), "west"),  # a corner, turned
    ],
    ids=["far", "across", "in the wall", "shade", "corner"],
)
@pytest.mark.parametrize("walls", [WallsCfg(), None], ids=["built", "props"])
def test_furniture_outside_of_rooms_is_refused_with_the_nearest_room(outside, nearest, walls):
    extent = {"west": ("4 m",), "east": ("4.1", "8.1 m")}[nearest]
    parts = ("'house'", f"'{outside.name}'", f"position_m={outside.position_m}", f"'{nearest}'")
    with pytest.raises(ValueError, match=naming(*parts, *extent)):
        house(outside, walls=walls)


def test_furniture_may_stand_at_a_wall_and_a_round_piece_may_be_turned():
    round_pieces = [piece("lamp", 0.18, 3.82, 45.0), piece("plant", 7.9, 3.8, 30.0)]
    pieces = [piece("bed", 0.95, 0.45), *round_pieces]
    assert house(*pieces).furniture == pieces


def test_furniture_may_stand_on_the_border_of_rooms_that_touch():
    rooms = [ROOMS[0], replace(ROOMS[1], lower_m=(4.0, 0.0, 0.0))]
    sofa = piece("sofa", 4.0, 2.0)
    assert PlaygroundCfg("open", rooms, furniture=[sofa]).furniture == [sofa]


@pytest.mark.parametrize(
    ("other", "depth_m"),
    [
        (piece("desk", 1.7, 1.0), "0.45"),
        (piece("chair", 1.0, 1.3), "0.30"),
        (piece("desk", 1.6, 1.5, 45.0), "0.45"),
    ],
)
def test_furniture_in_other_furniture_is_refused_by_both_names(other, depth_m):
    with pytest.raises(ValueError, match=naming("'bed'", f"'{other.name}'", f"{depth_m} m")):
        house(piece("bed", 1.0, 1.0), other)


def test_furniture_may_touch_or_stand_below():
    touching = [piece("bed", 1.0, 1.0), piece("desk", 2.5, 1.0), piece("stool", 1.0, 1.61)]
    below = [piece("table", 6.0, 3.0), piece("stool", 6.0, 3.1, name="under the table")]
    assert house(*touching, *below).furniture == [*touching, *below]


@pytest.mark.parametrize("x", [3.6, 4.5])
@pytest.mark.parametrize("walls", [WallsCfg(), None], ids=["built", "props"])
def test_furniture_in_a_door_is_refused_on_both_sides(x, walls):
    in_front = piece("armchair", x, 2.7)
    with pytest.raises(ValueError, match=naming("'armchair'", "door 'door'", "(4.05, 2.0)")):
        house(in_front, walls=walls)
    house(replace(in_front, position_m=(x, 2.85)), walls=walls)


BALL = PropCfg("ball", PropShape.sphere, [0.2], (1.0, 1.0, -0.1), mass_kg=0.5)


def test_a_free_prop_below_the_floor_is_refused():
    with pytest.raises(ValueError, match=naming("prop 'ball'", "position_m=(1.0, 1.0, -0.1)")):
        house(props=[BALL])
    house(props=[replace(BALL, mass_kg=0.0)])  # a low mound
