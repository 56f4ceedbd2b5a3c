"""Walls that are built from rooms and doors."""

from dataclasses import replace

import numpy as np
import pytest
from floor_maps import FloorMap, pieces
from refusals import naming
from seeking import shipped

from veca_marl.sim.physics import (
    DoorCfg,
    FurnitureCfg,
    FurnitureKind,
    JointKind,
    LeafCfg,
    PlaygroundCfg,
    RoomCfg,
    WallsCfg,
    World,
)
from veca_marl.sim.physics.houses.furniture import FURNITURE, furniture_prop
from veca_marl.sim.physics.houses.walls import wall_lines


def row(count, gap_m=0.1, walls=None, **numbers):
    """Rooms of 3 x 3 m in a row along x."""
    rooms = [
        RoomCfg(f"room_{n}", (n * (3.0 + gap_m), 0.0, 0.0), (3.0, 3.0, 2.5)) for n in range(count)
    ]
    return PlaygroundCfg(name="row", rooms=rooms, walls=walls or WallsCfg(), **numbers)


def test_rooms_in_a_row_share_the_walls_between_them():
    lines = wall_lines(row(3).rooms, 0.1)
    across = [line for line in lines if line.axis == 0]
    along = [line for line in lines if line.axis == 1]
    np.testing.assert_allclose([line.at_m for line in across], [-0.05, 3.05, 6.15, 9.25])
    assert [(line.begin_m, line.end_m) for line in along] == [pytest.approx((-0.05, 9.25))] * 2


def test_a_door_is_an_opening_with_a_wall_above():
    door = DoorCfg("door", ("room_0", "room_1"), (3.05, 1.0), 1.0)
    walls = {prop.name: prop for prop in row(2, doors=[door]).built_props()}
    assert walls["wall_1_0"].size_m == pytest.approx([0.1, 0.55, 2.5])
    assert walls["wall_1_1"].size_m == pytest.approx([0.1, 1.55, 2.5])
    assert walls["wall_over_door"].position_m == pytest.approx((3.05, 1.0, 2.0))
    assert walls["wall_over_door"].size_m == pytest.approx([0.1, 1.0, 0.5])


SLIDE = LeafCfg(JointKind.slide)


@pytest.mark.parametrize(
    ("door", "direction", "wall"),
    [
        (DoorCfg("door", ("room_0", "room_1"), (3.05, 1.0), 1.0, SLIDE), (0.0, 1.0), "wall_1_1"),
        (
            DoorCfg(
                "door",
                ("room_0", "room_1"),
                (3.05, 2.0),
                1.0,
                LeafCfg(JointKind.slide, opens_to_front=False),
            ),
            (0.0, -1.0),
            "wall_1_0",
        ),
    ],
)
def test_a_sliding_leaf_moves_into_the_wall_on_its_side(door, direction, wall):
    props = {prop.name: prop for prop in row(2, doors=[door]).built_props()}
    assert props["leaf_door"].joint.parent == wall
    assert list(props).index(wall) < list(props).index("leaf_door")
    assert opened_by(door, row(2)) == pytest.approx((*(0.86 * np.array(direction)), 0.0), abs=1e-6)


@pytest.mark.parametrize(("front", "shift"), [(True, 0.86), (False, -0.86)])
def test_a_sliding_leaf_in_a_wall_along_x_opens_towards_greater_x_at_its_front(front, shift):
    rooms = [
        RoomCfg("a", (0.0, 0.0, 0.0), (4.0, 3.0, 2.5)),
        RoomCfg("b", (0.0, 3.1, 0.0), (4.0, 3.0, 2.5)),
    ]
    leaf = LeafCfg(JointKind.slide, opens_to_front=front)
    door = DoorCfg("door", ("a", "b"), (2.0, 3.05), 1.0, leaf)
    flat = PlaygroundCfg("flat", rooms, walls=WallsCfg())
    assert opened_by(door, flat) == pytest.approx((shift, 0.0, 0.0), abs=1e-6)


def opened_by(door, playground):
    """Return how far the leaf of a door moves when it is opened."""
    world = World(replace(playground, doors=[door]))
    leaf = world.prop("leaf_door")
    leaf.set_opening(0.0)
    closed = leaf.position
    leaf.set_opening(1.0)
    moved = leaf.position - closed
    world.close()
    return moved


@pytest.mark.parametrize(
    ("y_m", "walls", "leaf", "parts"),
    [
        (2.3, WallsCfg(), SLIDE, ("1.0 m", "0.25 m", "leaf.opens_to_front=false")),
        (1.0, WallsCfg(0.04), SLIDE, ("walls.thickness_m=0.04", "leaf", "0.04 m")),
        (1.0, WallsCfg(0.03), LeafCfg(), ("walls.thickness_m=0.03", "leaf")),
    ],
)
def test_a_wall_that_cannot_take_the_leaf_is_refused(y_m, walls, leaf, parts):
    door = DoorCfg("door", ("room_0", "room_1"), (3.0 + walls.thickness_m / 2, y_m), 1.0, leaf)
    with pytest.raises(ValueError, match=naming("'door'", *parts)):
        row(2, walls.thickness_m, walls, doors=[door])


@pytest.mark.parametrize("z", [1.0, -0.2])
def test_walls_are_built_round_rooms_on_the_floor_only(z):
    rooms = [RoomCfg("raised", (0.0, 0.0, z), (3.0, 3.0, 2.5))]
    with pytest.raises(ValueError, match=naming("'raised'", f"lower_m=(0.0, 0.0, {z})")):
        PlaygroundCfg(name="house", rooms=rooms, walls=WallsCfg())


@pytest.mark.parametrize("apart_m", [0.5, 1.0])
def test_doors_that_overlap_or_touch_are_refused_by_their_names(apart_m):
    doors = [
        DoorCfg(name, ["room_0", "room_1"], (3.05, y), 1.0)
        for name, y in (("near", 0.8), ("far", 0.8 + apart_m))
    ]
    with pytest.raises(ValueError, match=naming("'near'", "'far'", f"{apart_m:.2f} m")):
        row(2, doors=doors)


@pytest.mark.parametrize(
    ("leaf", "width_m", "height_m", "parts"),
    [
        (LeafCfg(JointKind.slide), 0.13, 2.0, ("width_m=0.13", "0.14")),
        (LeafCfg(), 0.02, 2.0, ("width_m=0.02",)),
        (LeafCfg(), 1.0, 0.02, ("height_m=0.02",)),
    ],
)
def test_an_opening_without_place_for_its_leaf_is_refused(leaf, width_m, height_m, parts):
    door = DoorCfg("door", ["room_0", "room_1"], (3.05, 1.5), width_m, leaf)
    with pytest.raises(ValueError, match=naming("leaf_door", *parts)):
        row(2, doors=[door], walls=WallsCfg(door_height_m=height_m))


def test_an_opening_that_reaches_beyond_a_room_is_refused():
    """The wall of the smaller room would stand in the opening."""
    rooms = [
        RoomCfg("hall", (0.0, -2.1, 0.0), (6.1, 2.0, 2.5)),
        RoomCfg("one", (0.0, 0.0, 0.0), (3.0, 3.0, 2.5)),
        RoomCfg("other", (3.1, 0.0, 0.0), (3.0, 3.0, 2.5)),
    ]
    door = DoorCfg("door", ("hall", "one"), (2.5, -0.05), 1.0)
    PlaygroundCfg("flat", rooms, [door], walls=WallsCfg())
    with pytest.raises(ValueError, match=naming("2.10", "3.10 m", "'one'")):
        PlaygroundCfg("flat", rooms, [replace(door, position_m=(2.6, -0.05))], walls=WallsCfg())


@pytest.mark.parametrize(("gap_m", "at_m"), [(0.15, 3.05), (0.15, 3.1), (0.3, 3.05)])
def test_a_door_that_another_wall_fills_is_refused_with_the_gap(gap_m, at_m):
    """Each room had its own wall, and the door was an opening in one of them only."""
    door = DoorCfg("door", ("room_0", "room_1"), (at_m, 1.0), 1.0)
    with pytest.raises(
        ValueError,
        match=naming("'door'", "'room_0'", "'room_1'", f"{gap_m} m", "walls.thickness_m=0.1"),
    ):
        row(2, gap_m, doors=[door])
    assert len(row(2, gap_m).built_props()) == 8  # without a door rooms may be so far apart


def test_a_door_in_a_wall_on_the_far_side_of_a_room_is_refused():
    rooms = [
        RoomCfg("narrow", (0.0, 0.0, 0.0), (0.3, 3.0, 2.5)),
        RoomCfg("wide", (0.4, 0.0, 0.0), (3.0, 3.0, 2.5)),
    ]
    door = DoorCfg("door", ("narrow", "wide"), (-0.05, 1.0), 1.0)
    with pytest.raises(ValueError, match=naming("'door'", "'narrow'", "'wide'")):
        PlaygroundCfg("flat", rooms, [door], walls=WallsCfg())


def test_rooms_are_separate_without_a_door_and_connected_by_it():
    door = DoorCfg("door", ("room_0", "room_1"), (3.05, 1.0), 1.0)
    assert FloorMap(row(2)).count == 2
    assert FloorMap(row(2, doors=[door])).count == 1


def test_rooms_that_are_too_near_for_a_wall_are_refused():
    with pytest.raises(ValueError, match=naming("'room_0'", "wall", "0.1 m")):
        row(2, gap_m=0.05)


def test_a_door_beside_the_wall_is_refused():
    door = DoorCfg("door", ("room_0", "room_1"), (3.2, 1.0), 1.0)
    with pytest.raises(ValueError, match=naming("['door']", "walls.thickness_m=0.1")):
        row(2, doors=[door])


@pytest.mark.parametrize(
    "wrong", [{"thickness_m": 0.0}, {"door_height_m": -1.0}, {"colours": [[2.0, 0.0, 0.0]]}]
)
def test_impossible_walls_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong)).removesuffix("s")):
        WallsCfg(**wrong)


@pytest.mark.parametrize("kind", FurnitureKind)
def test_furniture_stands_on_the_floor_within_its_area(kind):
    piece, cfg = FURNITURE[kind], FurnitureCfg("piece", kind, (2.0, 3.0), 90.0)
    plain = FurnitureCfg("piece", kind)
    feet = []
    for part in pieces([furniture_prop(plain)]):
        x, y, z = part.position_m
        round_m = part.size_m[0] if part.shape.name != "box" else 0.0
        half = (round_m, round_m) if round_m else (part.size_m[0] / 2, part.size_m[1] / 2)
        assert abs(x) + half[0] <= piece.width_m / 2 + 1e-9, part.name
        assert abs(y) + half[1] <= piece.depth_m / 2 + 1e-9, part.name
        heights = {"sphere": 2 * part.size_m[0], "box": part.size_m[-1]}
        feet.append(z - heights.get(part.shape.name, part.size_m[-1]) / 2)
    assert min(feet) == pytest.approx(0.0)
    turned, straight = (list(pieces([furniture_prop(one)]))[-1] for one in (cfg, plain))
    x, y, z = straight.position_m
    assert turned.position_m == pytest.approx((2.0 - y, 3.0 + x, z))


def test_an_unknown_piece_is_refused():
    with pytest.raises(ValueError, match=naming("'seat'", "kind='throne'", "armchair")):
        FurnitureCfg("seat", kind="throne")


@pytest.mark.parametrize("house", ["house", "house2"])
def test_a_walker_reaches_everything_in_the_furnished_houses(house):
    playground = shipped(house)
    assert FloorMap(playground).count == 1
    assert len(playground.furniture) >= 4 * len(playground.rooms) - 1
