"""Obstacles inside a room: which of the paths they block."""

import numpy as np
import pytest
from listening import ROOM_SIZE, STEP, make_receiver

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound import Clip, House, Room, SoundField
from veca_marl.sim.sound.blocked_paths import (
    contains_point,
    count_crossed,
    count_crossed_inside,
    crosses_box,
)
from veca_marl.sim.sound.room_acoustics import image_lattice, image_sources

ROOM = Room((1.0, -2.0, 0.5), ROOM_SIZE, 0.7)
LATTICE = image_lattice(3)
LOSS_DB = 30.0


def random_rotation(rng):
    rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return np.ascontiguousarray(rotation)


def random_scene(seed):
    rng = np.random.default_rng(seed)
    source, head, centre = rng.uniform(0.05, 0.95, (3, 3)) * ROOM.size + ROOM.lower
    return source, head, (centre, random_rotation(rng), rng.uniform(0.1, 1.5, 3))


def counts(source, head, box):
    boxes = (part[None] for part in box)
    return count_crossed_inside(source, head, ROOM.bounds(), ROOM.lower, ROOM.size, LATTICE, *boxes)


@pytest.mark.parametrize("seed", range(8))
def test_blocked_paths_are_those_that_meet_the_box_when_they_are_folded_point_by_point(seed):
    source, head, (centre, rotation, half) = random_scene(seed)
    box = centre, rotation, 0.6 * half
    if contains_point(source, *box) or contains_point(head, *box):
        pytest.skip("the box is round the source or the head")
    expected = []
    for image in image_sources(source, ROOM.lower, ROOM.size, LATTICE):
        line = np.linspace(head, image, 4001) - ROOM.lower
        cell = np.floor(line / ROOM.size).astype(int)
        along = line - cell * ROOM.size
        folded = np.where(cell % 2 == 1, ROOM.size - along, along) + ROOM.lower
        in_box = (np.abs((folded - centre) @ rotation) <= box[2]).all(axis=1)
        expected.append(in_box.any())
    found = counts(source, head, box)
    assert found.max() <= 1
    # the points are up to 8 mm apart: they can miss a corner of the box
    assert np.count_nonzero(found.astype(bool) != np.array(expected)) <= 1


@pytest.mark.parametrize("seed", range(20))
def test_the_same_paths_are_blocked_with_source_and_head_exchanged(seed):
    source, head, box = random_scene(seed)
    there, back = counts(source, head, box), counts(head, source, box)
    # an even number of reflections on an axis begins at the opposite wall in reverse
    reverse = np.where(LATTICE % 2 == 0, -LATTICE, LATTICE)
    order = [np.flatnonzero((row == LATTICE).all(axis=1))[0] for row in reverse]
    assert np.array_equal(there, back[order])


def wall(x, height=3.0):
    return np.array([x, 1.0, 0.5 + height / 2]), np.eye(3), np.array([0.05, 3.0, height / 2])


def test_a_screen_blocks_the_direct_sound_but_not_the_reflection_at_the_ceiling():
    source, head = np.array([3.0, 1.0, 1.5]), np.array([7.0, 1.0, 1.5])
    blocked = counts(source, head, wall(5.0, height=1.6))
    by_reflections = dict(zip(map(tuple, LATTICE), blocked, strict=True))
    assert by_reflections[0, 0, 0] == 1
    assert by_reflections[0, 0, 1] == 0  # ceiling
    assert by_reflections[0, 0, -1] == 1  # floor


def test_boxes_outside_the_room_and_round_the_source_or_the_head_do_not_count():
    source, head = np.array([3.0, 1.0, 1.5]), np.array([7.0, 1.0, 1.5])
    assert counts(source, head, wall(5.0)).all()
    assert not counts(source, head, wall(3.0)).any()
    assert not counts(source, head, wall(7.0)).any()
    assert not counts(source, head, wall(9.05)).any()


def test_a_wall_that_is_moved_between_source_and_listener_attenuates_all_paths():
    """Before, obstacles inside one room were not considered."""
    house = House([ROOM], 1, LOSS_DB)
    number = house.obstacles.add((0.05, 3.0, 1.5))
    field = SoundField(house, STEP)
    sound = np.random.default_rng(0).standard_normal(20 * STEP)
    field.add_source("noise", Clip(sound)).position = (3.0, 1.0, 1.5)
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))
    powers = []
    for step in range(20):
        house.obstacles.move(number, (5.0 if step >= 10 else 40.0, 1.0, 2.0), np.eye(3))
        field.advance()
        heard = listener.render(Pose(np.array([7.0, 1.0, 1.5]), np.eye(3)))
        powers.append(np.mean(heard**2))
    before, after = np.mean(powers[4:10]), np.mean(powers[13:])
    assert 10.0 * np.log10(before / after) == pytest.approx(LOSS_DB, abs=1.0)


def test_a_path_through_a_wall_is_symmetric():
    one, other, box = np.array([0.0, 0.2, 0.1]), np.array([3.0, 0.4, 0.9]), wall(1.5)
    assert crosses_box(one, other, *box)
    assert crosses_box(other, one, *box)


def pieces_of_a_wall():
    """A wall in the plane x = 1.5 with an opening from y = 0 to 1 below z = 2."""
    boxes = [((-2.0, 0.0), (0.0, 3.0)), ((1.0, 3.0), (0.0, 3.0)), ((0.0, 1.0), (2.0, 3.0))]
    centres = np.array([(1.5, sum(y) / 2, sum(z) / 2) for y, z in boxes])
    halves = np.array([(0.05, (y[1] - y[0]) / 2, (z[1] - z[0]) / 2) for y, z in boxes])
    return centres, np.repeat(np.eye(3)[None], 3, axis=0), halves


@pytest.mark.parametrize(
    ("one", "other", "walls"),
    [
        ((0.0, 0.2, 2.5), (3.0, 0.4, 2.5), 1),  # above the opening
        ((0.0, -0.6, 2.4), (3.0, 0.6, 2.4), 1),  # from beside it to above it, within the wall
        ((0.0, 1.6, 2.4), (3.0, 0.4, 2.4), 1),
        ((0.0, 0.2, 1.0), (3.0, 0.4, 1.0), 0),  # through the opening
    ],
)
def test_the_pieces_of_one_wall_count_once(one, other, walls):
    assert count_crossed(np.array(one), np.array(other), *pieces_of_a_wall()) == walls
    assert count_crossed(np.array(other), np.array(one), *pieces_of_a_wall()) == walls


def test_two_walls_one_behind_the_other_count_twice():
    centres, rotations, halves = (np.concatenate([part, part]) for part in pieces_of_a_wall())
    centres[3:, 0] += 1.0
    ends = np.array([0.0, -1.0, 1.0]), np.array([4.0, -1.2, 1.0])
    assert count_crossed(*ends, centres, rotations, halves) == 2


def test_the_pieces_of_one_wall_count_once_inside_a_room():
    """A path inside one room is attenuated as the same path between two rooms is."""
    gains = []
    whole = [Room((0.0, 0.0, 0.0), (6.0, 6.0, 2.6), 0.5)]
    halves = [Room((x, 0.0, 0.0), (2.95, 6.0, 2.6), 0.5) for x in (0.0, 3.05)]
    for rooms in (whole, halves):
        house = House(rooms, image_order=0)
        for y in (1.5, 4.5):
            piece = house.obstacles.add((0.05, 1.5, 1.3))
            house.obstacles.move(piece, (3.0, y, 1.3), np.eye(3))
        head = Pose(np.array([4.0, 4.0, 1.2]), np.eye(3))
        gains.append(house.arrivals(np.array([2.0, 2.0, 1.2]), head).gains)
    np.testing.assert_allclose(gains[0], gains[1])
