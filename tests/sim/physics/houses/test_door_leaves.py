"""A leaf has room to slide or to turn, or is refused with what is possible."""

from itertools import product

import numpy as np
import pytest
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

HEIGHT_M = 2.5


def sliding(front, **numbers):
    return LeafCfg(JointKind.slide, opens_to_front=front, **numbers)


def junction(at_m, front, width_m=1.0, turned=False, thickness_m=0.1):
    """A hall along two rooms; the wall between them meets that of the hall from 3.0 m on.

    Args:
        at_m: The middle of the door between the hall and one of the rooms.
        front: Whether its leaf slides to greater coordinates.
        width_m: Width of the door.
        turned: Whether x and y are exchanged.
        thickness_m: Of the walls.
    """
    t = thickness_m
    plan = {
        "hall": ((0.0, -2.0 - t), (6.0 + t, 2.0)),
        "one": ((0.0, 0.0), (3.0, 3.0)),
        "other": ((3.0 + t, 0.0), (3.0, 3.0)),
    }
    turn = slice(None, None, -1 if turned else 1)
    rooms = [
        RoomCfg(name, (*low[turn], 0.0), (*size[turn], HEIGHT_M))
        for name, (low, size) in plan.items()
    ]
    to = "one" if at_m < 3.0 else "other"
    door = DoorCfg("door", ("hall", to), (at_m, -t / 2)[turn], width_m, sliding(front))
    return PlaygroundCfg("junction", rooms, [door], walls=WallsCfg(t))


def opening_reached(playground, door="door"):
    """Return how far the motor opens a door that is closed."""
    world = World(playground)
    leaf = world.prop(f"leaf_{door}")
    leaf.set_opening(0.0)
    assert leaf.open()
    for _ in range(60):
        world.step()
    opening = leaf.opening
    world.close()
    return opening


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("at_m", "front"), [(4.0, False), (2.1, True)])
def test_a_leaf_that_would_meet_another_wall_is_refused_with_the_other_side(at_m, front, turned):
    other_side = "true" if not front else "false"
    with pytest.raises(
        ValueError,
        match=naming(
            "'door'", "'wall_", "0.40 m", f"leaf.opens_to_front={other_side}", "leaf.kind=hinge"
        ),
    ):
        junction(at_m, front, turned=turned)
    assert opening_reached(junction(at_m, not front, turned=turned)) == pytest.approx(1.0)


def test_a_side_that_is_no_better_is_not_advised():
    """Rooms of 1.9 m above the hall: the walls on both sides of the door meet that of the hall."""
    rooms = [RoomCfg("hall", (0.0, -2.1, 0.0), (5.9, 2.0, HEIGHT_M))]
    rooms += [RoomCfg(f"room_{n}", (2.0 * n, 0.0, 0.0), (1.9, 3.0, HEIGHT_M)) for n in range(3)]
    for front in (True, False):
        door = DoorCfg("door", ("hall", "room_1"), (2.95, -0.05), 1.0, sliding(front))
        with pytest.raises(ValueError, match=naming("0.45 m", "leaf.kind=hinge")) as refusal:
            PlaygroundCfg("rooms", rooms, [door], walls=WallsCfg())
        assert "opens_to_front" not in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_every_sliding_leaf_that_is_accepted_opens_and_closes(turned):
    accepted = 0
    for at_m, front, width_m in product(np.arange(0.6, 6.0, 0.3), (True, False), (0.5, 0.8, 1.1)):
        try:
            playground = junction(float(at_m), front, width_m, turned)
        except ValueError:
            continue
        accepted += 1
        assert opening_reached(playground) == pytest.approx(1.0), (at_m, front, width_m)
    assert accepted > 30


def test_the_corner_of_a_thick_wall_counts():
    """The wall of 0.6 m is as long as the leaf, but half of its thickness is that of the corner."""
    with pytest.raises(ValueError, match=naming("'wall_", "0.75 m")):
        junction(1.25, False, thickness_m=0.6)


def row_with_two_doors(first, second, apart_m, front, other_front):
    rooms = [
        RoomCfg("a", (0.0, 0.0, 0.0), (8.0, 3.0, HEIGHT_M)),
        RoomCfg("b", (0.0, 3.1, 0.0), (8.0, 3.0, HEIGHT_M)),
    ]
    doors = [
        DoorCfg(name, ("a", "b"), (x, 3.05), 1.0, sliding(to_front))
        for name, x, to_front in (
            (first, 4.0 - apart_m / 2, front),
            (second, 4.0 + apart_m / 2, other_front),
        )
    ]
    return PlaygroundCfg("row", rooms, doors, walls=WallsCfg())


def test_two_leaves_that_would_meet_in_one_wall_are_refused():
    with pytest.raises(ValueError, match=naming("'one'", "'two'", "leaf.opens_to_front")):
        row_with_two_doors("one", "two", 2.6, True, False)
    for numbers in ((2.8, True, False), (2.6, True, True), (2.6, False, True)):
        playground = row_with_two_doors("one", "two", *numbers)
        assert opening_reached(playground, "one") == pytest.approx(1.0)
        assert opening_reached(playground, "two") == pytest.approx(1.0)


def test_the_sliding_door_of_house2_opens():
    assert opening_reached(shipped("house2"), "door_kitchen") == pytest.approx(1.0)


# ---- hinged leaves


def hinged(at_m=1.5, front=True, furniture=(), turned=False, thickness_m=0.1):
    """Two rooms of 3 m along a wall, with a hinged door in it; the hinge is at the end in +x."""
    t = thickness_m
    turn = slice(None, None, -1 if turned else 1)
    rooms = [
        RoomCfg(name, (*(0.0, y)[turn], 0.0), (3.0, 3.0, HEIGHT_M))
        for name, y in (("a", 0.0), ("b", 3.0 + t))
    ]
    door = DoorCfg(
        "door", ("a", "b"), (at_m, 3.0 + t / 2)[turn], 1.0, LeafCfg(opens_to_front=front)
    )
    return PlaygroundCfg("pair", rooms, [door], walls=WallsCfg(t), furniture=list(furniture))


@pytest.mark.parametrize(("at_m", "turned"), [(2.49, False), (0.51, True)])
@pytest.mark.parametrize("front", [True, False])
def test_a_leaf_whose_handle_would_meet_a_side_wall_is_refused(at_m, turned, front):
    """The hinge is 1 cm beside the wall; the handle stands out by 3 cm."""
    parts = ("'pair'", "'door'", "'wall_", "90 degrees")
    with pytest.raises(ValueError, match=naming(*parts)) as refusal:
        hinged(at_m, front, turned=turned)
    assert "opens_to_front" not in str(refusal.value)
    assert str(refusal.value).count("'wall_") == 1  # walls are no choice of what to move
    inner_m = at_m - 0.03 if not turned else at_m + 0.03
    assert opening_reached(hinged(inner_m, front, turned=turned)) == pytest.approx(1.0, abs=0.01)


def test_a_side_wall_at_the_other_end_of_a_leaf_is_no_hindrance():
    assert opening_reached(hinged(0.5)) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("front", [True, False])
def test_a_leaf_that_would_meet_furniture_is_refused_with_the_choices(front):
    chest = FurnitureCfg("chest", FurnitureKind.toy_chest, (1.5, 3.1 + 0.7 if front else 2.3))
    with pytest.raises(
        ValueError,
        match=naming(
            "'door'", "'chest'", "90 degrees", f"leaf.opens_to_front={str(not front).lower()}"
        ),
    ):
        hinged(front=front, furniture=[chest])
    playground = hinged(front=not front, furniture=[chest])
    assert opening_reached(playground) == pytest.approx(1.0, abs=0.01)


def test_furniture_on_both_sides_leaves_no_choice_of_the_side():
    chests = [
        FurnitureCfg(f"chest_{n}", FurnitureKind.toy_chest, (1.5, y))
        for n, y in ((1, 2.3), (2, 3.8))
    ]
    with pytest.raises(ValueError, match=naming("90 degrees", "'chest_2'")) as refusal:
        hinged(furniture=chests)
    assert "opens_to_front" not in str(refusal.value)


def test_every_hinged_leaf_that_is_accepted_opens():
    accepted = 0
    for x, front, thickness_m in product(np.arange(0.5, 2.6, 0.2), (True, False), (0.1, 0.4)):
        chest = FurnitureCfg("chest", FurnitureKind.toy_chest, (float(x), 3.0 + thickness_m + 0.9))
        try:
            playground = hinged(1.5, front, [chest], thickness_m=thickness_m)
        except ValueError:
            continue
        accepted += 1
        assert opening_reached(playground) == pytest.approx(1.0, abs=0.01), (x, front)
    assert 20 < accepted < 44
