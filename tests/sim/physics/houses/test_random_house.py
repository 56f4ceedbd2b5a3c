"""Generated houses are valid for every seed: connected, passable, furnished, reproducible."""

import math
from dataclasses import replace

import numpy as np
import pytest
from composed import compose
from floor_maps import FloorMap, pieces
from omegaconf import OmegaConf
from refusals import naming

from veca_marl.config import compose_node, to_config
from veca_marl.config.stored import body_names, typed
from veca_marl.sim.physics import RandomHouseCfg, World
from veca_marl.sim.physics.houses.floor_division import FloorNeeds
from veca_marl.sim.physics.houses.generated_doors import floor_of, open_leaf, turns_into
from veca_marl.sim.physics.houses.walls import WallsCfg

WIDE_M = 0.15
FEW_AND_MANY = pytest.mark.parametrize(
    "count", [pytest.param(8, id="few"), pytest.param(200, id="many", marks=pytest.mark.slow)]
)
SIZES = [
    {"room_count": 1, "house_size_m": (3.2, 3.2)},
    {"room_count": 2, "house_size_m": (6.5, 3.2), "pieces_per_room": (4, 4)},
    {"room_count": 9, "house_size_m": (9.8, 9.8), "loops": 0.0},
    {"room_count": 3, "house_size_m": (14.0, 6.0), "loops": 1.0, "door_width_m": 0.7},
]


def some_seeds(count):
    """Seeds of houses: the tests hold for all of them."""
    return np.random.default_rng(0).integers(0, 1_000_000, count).tolist()


def check(house, also=(), wide_m=WIDE_M, most_closed_off=5):
    """The laws of a generated house, with further things in it.

    Places closed off are counted in cells of 4 cm.
    """
    floor, wide = FloorMap(house, also=also), FloorMap(house, radius_m=wide_m, also=also)
    reached = set(floor.labels[wide.free])
    assert len(reached) == 1, "a walker reaches every place with some space round it"
    assert {floor.label(door.position_m) for door in house.doors} <= reached
    assert floor.free.sum() - (floor.labels == reached.pop()).sum() <= most_closed_off
    for room in house.rooms:
        assert min(room.size_m[:2]) >= house.least_room_m - 1e-5, "but for rounding"
        assert floor.in_box(np.add(room.lower_m, room.size_m), room)[floor.free].any()
    assert len(house.rooms) == house.room_count
    assert len(house.doors) >= house.room_count - 1
    assert all(width == house.door_width_m for width in (door.width_m for door in house.doors))


@FEW_AND_MANY
def test_every_seed_gives_a_house_in_which_a_walker_reaches_everything(count):
    pieces = []
    for seed in some_seeds(count):
        house = RandomHouseCfg(seed=seed)
        check(house)
        pieces.append(len(house.furniture))
    assert min(pieces) >= 10, "most of the 15 to 25 pieces find a place"


@pytest.mark.parametrize("count", [3, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("leaves", [0.0, 1.0], ids=["plain", "leaves"])
@pytest.mark.parametrize("numbers", SIZES, ids=lambda numbers: str(numbers["room_count"]))
def test_other_sizes_are_valid_too(numbers, leaves, count):
    for seed in some_seeds(count):
        check_with_leaves(RandomHouseCfg(seed=seed, leaves=leaves, **numbers))


@pytest.mark.parametrize(
    ("seed", "numbers"),
    [
        *((seed, {}) for seed in (232, 641, 1003)),  # the last piece closed a position off
        *((seed, SIZES[2]) for seed in (10248, 10265)),
        *((seed, {"leaves": 1.0}) for seed in (2012, 2499)),
        *((seed, {"leaves": 1.0}) for seed in (2038, 2121, 2385, 2389, 2453)),  # a leaf met a piece
    ],
)
def test_houses_that_were_invalid_once(seed, numbers):
    check_with_leaves(RandomHouseCfg(seed=seed, **numbers))


@pytest.mark.parametrize("width_m", [0.3, 0.35, 0.5])
def test_leaves_that_leave_too_little_of_a_narrow_door_are_left_out(width_m):
    for seed in some_seeds(3):
        house = RandomHouseCfg(seed=seed, leaves=1.0, door_width_m=width_m)
        check_with_leaves(house)
        assert all(door.leaf is None for door in house.doors) or width_m > 0.3


def test_narrow_doors_in_thick_walls_are_passed():
    walls = WallsCfg(thickness_m=0.45)
    for seed in some_seeds(3):
        check_with_leaves(RandomHouseCfg(seed=seed, leaves=0.5, door_width_m=0.35, walls=walls))


def check_with_leaves(house):
    """The laws of a generated house with or without leaves; positions beside leaves are tighter."""
    hung = open_leaves(house)
    if hung:
        check(house, hung, wide_m=0.2, most_closed_off=30)
    else:
        check(house)
    return hung


def open_leaves(house):
    """The leaves of a house as fixed props where they are in the simulator at the start."""
    world, leaves = World(house), []
    for door in house.doors:
        if door.leaf is not None:
            leaf = world.prop(f"leaf_{door.name}")
            place, yaw_deg = tuple(leaf.position.tolist()), math.degrees(leaf.yaw_rad)
            fixed = replace(leaf.cfg, joint=None, mass_kg=0.0)
            leaves.append(replace(fixed, name=door.name, position_m=place, yaw_deg=yaw_deg))
    world.close()
    return leaves


def box_round(prop):
    """Middle and size of the rectangle round the boxes that a prop consists of."""
    corners = []
    for part in pieces([prop]):
        c, s = abs(math.cos(math.radians(part.yaw_deg))), abs(math.sin(math.radians(part.yaw_deg)))
        x, y = np.array(part.size_m[:2]) / 2.0
        half = np.array([c * x + s * y, s * x + c * y])
        corners += [np.subtract(part.position_m[:2], half), np.add(part.position_m[:2], half)]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return (low + high) / 2.0, high - low


@pytest.mark.slow
@FEW_AND_MANY
def test_a_walker_reaches_everything_while_leaves_are_open(count):
    """That they can turn is checked by the configuration of every playground."""
    leaves, doors = 0, 0
    for seed in some_seeds(count):
        house = RandomHouseCfg(seed=seed, leaves=1.0)
        hung = check_with_leaves(house)
        assert all(house.rooms[0].distance_m(leaf.position_m[:2]) > 0.2 for leaf in hung)
        leaves, doors = leaves + len(hung), doors + len(house.doors)
    assert leaves > 0.6 * doors


def test_the_floor_that_open_leaves_cover_is_where_the_leaves_are():
    """Leaves of both kinds of walls, to either side, against their poses in the simulator."""
    kinds = set()
    for seed in some_seeds(8):
        house = RandomHouseCfg(seed=seed, leaves=1.0)
        boxes = {leaf.name: box_round(leaf) for leaf in open_leaves(house)}
        for door in house.doors:
            for floor in (floor_of(room) for room in house.rooms if room.name in door.rooms):
                if not turns_into(floor, door):
                    continue
                covered, (middle, size) = open_leaf(floor, door), boxes[door.name]
                expected = np.add(covered.lower_m, np.divide(covered.size_m, 2.0))
                np.testing.assert_allclose(expected, middle, atol=0.06)
                np.testing.assert_allclose(covered.size_m, size, atol=0.05)
                kinds.add((size[0] > size[1], door.leaf.opens_to_front))
    assert len(kinds) == 4


def test_leaves_change_neither_rooms_nor_places_of_doors():
    hung = []
    for seed in some_seeds(8):
        plain, some = (RandomHouseCfg(seed=seed, leaves=share) for share in (0.0, 0.5))
        assert some.rooms == plain.rooms
        assert [replace(door, leaf=None) for door in some.doors] == plain.doors
        hung += [door.leaf is not None for door in some.doors]
    assert 0 < sum(hung) < len(hung)


def test_the_first_room_is_the_widest_with_its_middle_at_the_origin_and_free_side_walls():
    for seed in some_seeds(8):
        house = RandomHouseCfg(seed=seed)
        first, *others = house.rooms
        assert first.name == "living"
        assert min(first.size_m[:2]) >= max(min(room.size_m[:2]) for room in others)
        np.testing.assert_allclose(first.middle_m, 0.0, atol=0.01)
        own = [piece for piece in house.furniture if piece.name.startswith("living_")]
        assert {abs(piece.yaw_deg) for piece in own} == {90.0}


def test_every_room_keeps_an_open_floor():
    """Two places in each room, clear of everything, for the object and an agent."""
    needs = FloorNeeds()
    for seed in some_seeds(3):
        house = RandomHouseCfg(seed=seed)
        floor = FloorMap(house, radius_m=0.8)
        for room in house.rooms:
            inside = floor.in_box(np.add(room.lower_m, room.size_m), room) & floor.free
            places = np.array([floor.x[inside], floor.y[inside]])
            assert np.linalg.norm(np.ptp(places, axis=1)) >= needs.extent_m - 0.1


def test_the_same_seed_gives_the_same_house_and_another_one_differs():
    assert RandomHouseCfg(seed=3) == RandomHouseCfg(seed=3)
    assert RandomHouseCfg(seed=3).rooms != RandomHouseCfg(seed=4).rooms


def test_the_command_line_chooses_seed_and_size():
    words = ["+task=KickTheBall", "playground=random_house", "playground.seed=7"]
    chosen = compose([*words, "playground.room_count=4"]).playground
    house = RandomHouseCfg(name="random_house", seed=7, room_count=4)
    assert (chosen.rooms, chosen.doors, chosen.furniture) == (
        house.rooms,
        house.doors,
        house.furniture,
    )


def test_a_stored_run_is_read_with_its_house():
    words = ["+task=KickTheBall", "playground=random_house", "playground.seed=7"]
    node = compose_node(words)
    stored = OmegaConf.to_container(node, resolve=True, enum_to_str=True)
    again = to_config(typed(stored, body_names(node))).playground
    assert isinstance(again, RandomHouseCfg)
    assert again.rooms == RandomHouseCfg(seed=7).rooms


@pytest.mark.parametrize("least_m", [10.0 / 3.0, 3.3333333, 2.9 + 1e-7])
def test_sizes_with_many_digits_are_divided(least_m):
    for seed in some_seeds(4):
        check(RandomHouseCfg(seed=seed, least_room_m=least_m))


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ("seed=-1", ("playground.seed=-1",)),
        ("room_count=7", ("room_count=7", "6", "house_size_m=(11.0, 9.0)")),
        ("room_count=0", ("room_count=0",)),
        ("house_size_m=[3,9]", ("house_size_m=(3.0, 9.0)", "least_room_m=3.2")),
        ("least_room_m=2", ("least_room_m=2.0", "2.90")),
        ("door_width_m=3", ("least_room_m=3.2", "3.50", "3.0 m")),
        ("door_width_m=0.1", ("playground.door_width_m=0.1", "0.3")),
        ("walls.door_height_m=0.3", ("playground.walls.door_height_m=0.3", "0.75")),
        ("room_height_m=0.3", ("playground.room_height_m=0.3", "0.75")),
        ("loops=2", ("loops=2.0",)),
        ("leaves=-0.1", ("leaves=-0.1",)),
        ("leaves=1; playground.walls.thickness_m=0.04", ("walls.thickness_m=0.04", "leaf")),
        ("pieces_per_room=[3,1]", ("pieces_per_room=(3, 1)",)),
        ("walls=null", ("playground.walls", "null")),
        ("rooms=[{name: attic}]", ("playground.rooms", "playground.seed")),
        ("generator=other", ("generator='other'", "'random_house'")),
    ],
)
def test_impossible_houses_are_refused_in_the_configuration(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        compose(
            ["+task=KickTheBall", "playground=random_house", *f"playground.{numbers}".split("; ")]
        )


def test_only_generated_playgrounds_have_a_seed():
    with pytest.raises(ValueError, match=naming("'playground.seed'")):
        compose(["+task=KickTheBall", "playground=house", "playground.seed=7"])


def test_a_generated_house_becomes_a_world():
    house = RandomHouseCfg(seed=7)
    world = World(house)
    assert {"wall_0", "floor_living"} <= set(world.props)
    assert {piece.name for piece in house.furniture} <= set(world.props)
    assert not world.prop("floor_living").cfg.tangible
    world.close()
