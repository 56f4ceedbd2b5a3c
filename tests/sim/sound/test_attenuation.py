"""What obstacles take from a sound: limits, order, continuity and reciprocity."""

import numpy as np
import pytest
from listening import RATE, STEP, make_receiver

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound import Clip, House, Room, SoundField
from veca_marl.sim.sound.partitions import BANDS_HZ, N_BANDS
from veca_marl.sim.sound.room_acoustics import image_lattice
from veca_marl.sim.sound.screens import Doorway
from veca_marl.sim.sound.shading import shelf_design, shelf_filters

WEST, EAST = (Room((x, -3.0, 0.0), (4.0, 6.0, 2.6), 0.5) for x in (-4.05, 0.05))
LOSS_DB = 30.0
WALL_PIECES = [  # with an opening of 1 x 2 m
    ((0.0, -1.75, 1.3), (0.05, 1.25, 1.3)),
    ((0.0, 1.75, 1.3), (0.05, 1.25, 1.3)),
    ((0.0, 0.0, 2.3), (0.05, 0.5, 0.3)),
]
WHOLE_WALL = [((0.0, 0.0, 1.3), (0.05, 3.0, 1.3))]
LEAF = (0.02, 0.49, 0.99)
CLOSED = np.array([0.0, 0.0, 1.0])
AT_500_HZ = 2
STEPS_PER_S = 25


DOORWAY = Doorway((0, 1), (0.0, 0.0), 1.0, 0)


def house(boxes, rooms=(WEST, EAST), order=0, doorways=()):
    built = House(rooms, order, LOSS_DB, doorways)
    for centre, half in boxes:
        built.obstacles.move(built.obstacles.add(half), centre, np.eye(3))
    return built


def one_room(*boxes):
    return house(boxes, [Room((-4.0, -3.0, 0.0), (8.0, 6.0, 2.6), 0.5)])


def loss_db(rooms, source, head):
    """Of the direct sound in each octave band."""
    return -10.0 * np.log10(rooms.direct_energy(np.array(source), np.array(head)))


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def with_door(angle, boxes=WALL_PIECES, order=0):
    """A leaf that is hinged at y = -0.49 and turned by an angle, in radians."""
    built = house(boxes, order=order, doorways=[DOORWAY])
    built.obstacles.add_leaf(LEAF)
    built.obstacles.move_opening(0, CLOSED, np.eye(3))
    turn_leaf(built, angle)
    return built


def turn_leaf(built, angle):
    rotation, hinge = turned(-angle), np.array([0.02, -0.49, 1.0])
    built.obstacles.move_leaf(0, hinge + rotation @ (CLOSED - hinge), rotation)


def test_without_obstacles_nothing_is_lost():
    assert (loss_db(house([]), (-2.0, 0.3, 1.2), (2.0, -0.4, 0.7)) == 0.0).all()
    assert (loss_db(one_room(), (-2.0, 0.3, 1.2), (2.0, -0.4, 0.7)) == 0.0).all()


@pytest.mark.parametrize("y", [-2.5, 0.0, 1.3])
def test_a_closed_wall_and_a_closed_door_transmit_only(y):
    ends = (-2.0, y, 1.2), (2.0, 0.8 * y, 0.9)
    for rooms in (house(WHOLE_WALL), with_door(0.0)):
        loss = loss_db(rooms, *ends)
        # where leaf, frame and lintel overlap their masses add
        assert loss[AT_500_HZ] == pytest.approx(LOSS_DB, abs=1.5)
        assert (np.diff(loss) > 0.0).all()
    assert loss_db(one_room(*WHOLE_WALL), *ends)[AT_500_HZ] == pytest.approx(LOSS_DB, abs=0.5)


def test_touching_panes_are_one_and_panes_apart_add_their_losses():
    def panes(n, apart):
        return loss_db(
            one_room(*[((apart * k, 0.0, 1.3), (0.005, 3.0, 1.3)) for k in range(n)]),
            (-1.5, 0.0, 1.0),
            (2.5, 0.0, 1.0),
        )[AT_500_HZ]

    # mass law: 6 dB for twice the mass
    assert panes(2, 0.01) - panes(1, 0.01) == pytest.approx(6.0, abs=0.5)
    assert panes(3, 0.01) - panes(1, 0.01) == pytest.approx(9.5, abs=0.5)
    assert panes(2, 1.0) == pytest.approx(2.0 * panes(1, 1.0), abs=1.0)
    gaps_m = np.geomspace(1e-4, 1.0, 60)
    by_gap = np.array([panes(2, 0.01 + gap) for gap in gaps_m])
    assert (np.diff(by_gap) > -1e-9).all()
    assert np.diff(by_gap).max() < 3.0


def test_behind_a_high_screen_the_loss_is_maekawas():
    for height in (1.2, 1.5, 1.8):
        rooms = house([((0.0, 0.0, height / 2), (0.001, 40.0, height / 2))], [
            Room((-50.0, -50.0, 0.0), (100.0, 100.0, 60.0), 0.0)
        ])  # fmt: skip
        loss = loss_db(rooms, (-2.0, 0.0, 1.0), (2.0, 0.0, 1.0))
        detour = 2.0 * np.hypot(2.0, height - 1.0) - 4.0
        maekawa = 10.0 * np.log10(3.0 + 20.0 * 2.0 * detour * BANDS_HZ / 343.0)
        through = 10.0 ** (-LOSS_DB / 10.0)
        expected = -10.0 * np.log10(10.0 ** (-maekawa / 10.0) + through)
        assert np.abs(loss - expected)[maekawa > 7.0].max() < 1.0


def test_a_narrow_box_takes_what_maekawa_has_and_grows_without_a_step():
    widths_m = np.linspace(0.05, 2.0, 79)
    ends = (-1.5, 0.0, 1.0), (1.5, 0.0, 1.0)
    losses = np.array(
        [loss_db(one_room(((0.0, 0.0, 0.9), (0.2, w / 2, 0.9))), *ends) for w in widths_m]
    )
    assert (np.diff(losses, axis=0) > -1e-9).all()
    assert np.diff(losses, axis=0).max() < 1.5
    assert 4.0 < losses[np.argmin(np.abs(widths_m - 0.7)), AT_500_HZ] < 8.0


def test_the_loss_is_continuous_and_falls_as_a_box_moves_out_of_a_path():
    places_m = np.linspace(0.0, 2.7, 541)
    ends = (-1.5, 0.1, 1.0), (1.5, -0.1, 1.0)
    losses = np.array(
        [loss_db(one_room(((0.0, y, 0.9), (0.2, 0.4, 0.9))), *ends) for y in places_m]
    )
    assert np.abs(np.diff(losses, axis=0)).max() < 0.7  # at 8 kHz and 5 mm
    assert losses[-1, AT_500_HZ:].max() == 0.0
    beside = losses[(places_m > 0.4) & (places_m < 2.0)]
    assert (np.diff(beside, axis=0) < 1e-9).all()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_box_that_falls_beside_a_path_takes_nothing(axis):
    """Its lower face leaves the floor, and its edges the vertical."""
    rooms = one_room(((0.0, 1.8, 0.5), (0.3, 0.3, 0.5)))
    ends = np.array([-3.0, 0.0, 0.5]), np.array([3.0, 0.0, 0.5])
    for angle in np.linspace(0.0, np.pi / 2, 31):
        c, s, tilted = np.cos(angle), np.sin(angle), np.eye(3)
        tilted[np.ix_((axis, 2), (axis, 2))] = (c, s), (-s, c)
        height = 0.5 * abs(c) + 0.3 * abs(s)
        rooms.obstacles.move(0, (0.0, 1.8, height), tilted)
        assert rooms.direct_energy(*ends)[2:].min() > 0.9


def test_through_an_open_door_nearly_nothing_is_lost_and_behind_the_wall_the_edge_takes_it():
    rooms = with_door(np.pi / 2)
    straight = loss_db(rooms, (-1.5, 0.2, 1.2), (1.5, 0.0, 1.0))
    assert straight[AT_500_HZ:].max() < 1.5
    behind = [
        loss_db(house(WALL_PIECES), (-2.0, y, 1.2), (2.0, y, 1.0))[AT_500_HZ]
        for y in np.linspace(0.0, 2.6, 131)
    ]
    assert (np.diff(behind) > -0.05).all()
    assert np.abs(np.diff(behind)).max() < 0.8
    assert behind[0] < 2.0
    assert 10.0 < behind[60] < 16.0  # 0.7 m behind the edge
    assert behind[-1] > 18.0


def door_lines():
    return [
        ((-2.0, 0.0, 1.2), (2.0, 0.0, 1.2)),
        ((-2.0, -0.35, 1.2), (2.0, -0.35, 1.2)),
        ((-2.0, 0.35, 1.2), (2.0, 0.35, 1.2)),
        ((-2.0, 1.5, 1.2), (2.0, -1.2, 1.2)),
        ((-2.0, -1.5, 1.2), (2.0, 1.2, 0.5)),
    ]


@pytest.mark.parametrize("line", range(5))
def test_a_door_that_opens_over_a_second_changes_no_step_by_more_than_3_db(line):
    angles = np.linspace(0.0, np.pi / 2, STEPS_PER_S + 1)
    energies = np.array(
        [with_door(a).direct_energy(*map(np.array, door_lines()[line])) for a in angles]
    )
    changes_db = np.abs(np.diff(10.0 * np.log10(energies), axis=0))
    assert changes_db[:, AT_500_HZ].max() <= 3.0
    pink_db = 10.0 * np.log10(energies.mean(axis=1))
    assert np.abs(np.diff(pink_db)).max() <= 3.0
    assert energies[-1].min() > 5.0 * energies[0].max()


def two_doors(one, other):
    """A wall with two doors, 3 m apart, the leaves turned by two angles."""
    pieces = [
        ((0.0, -2.75, 1.3), (0.05, 0.25, 1.3)),
        ((0.0, -0.5, 1.3), (0.05, 1.0, 1.3)),
        ((0.0, 2.25, 1.3), (0.05, 0.75, 1.3)),
        ((0.0, -2.0, 2.3), (0.05, 0.5, 0.3)),
        ((0.0, 1.0, 2.3), (0.05, 0.5, 0.3)),
    ]
    built = house(pieces)
    for number, (y, angle) in enumerate(((-2.0, one), (1.0, other))):
        built.obstacles.add_leaf(LEAF)
        built.obstacles.move_opening(number, (0.0, y, CLOSED[2]), np.eye(3))
        hinge = np.array([0.0, y - 0.49, 1.0])
        centre = hinge + turned(angle) @ (0.0, 0.49, 0.0)
        built.obstacles.move_leaf(number, centre, turned(angle))
    return built


@pytest.mark.parametrize("beside", [0.0, 0.3, 0.81, np.pi / 2])
def test_a_door_beside_a_path_takes_nothing_from_what_passes_an_open_one(beside):
    source, head = (-1.5, -2.0, 1.0), (1.5, -2.0, 1.0)
    alone, both = two_doors(np.pi / 2, np.pi / 2), two_doors(np.pi / 2, beside)
    assert (loss_db(both, source, head) - loss_db(alone, source, head) < 1.0).all()
    closed = two_doors(0.0, np.pi / 2)
    assert loss_db(closed, source, head)[AT_500_HZ] > 20.0


def test_of_two_doors_each_changes_the_level_as_alone():
    source, head = (-1.5, -2.0, 1.0), (1.5, -2.0, 1.0)
    for other in (0.0, 0.3, 0.5, np.pi / 2):
        levels = [loss_db(two_doors(a, other), source, head) for a in np.linspace(0, 1.57, 60)]
        assert np.abs(np.diff(levels, axis=0)).max() < 3.0
        assert levels[0][AT_500_HZ] - levels[-1][AT_500_HZ] > 20.0


@pytest.mark.parametrize("aside_m", [0.05, 0.1, 0.2, -0.1, -0.2])
def test_furniture_at_a_wall_takes_nothing_from_a_path_metres_beside_it(aside_m):
    for side in (1.0, -1.0):
        rooms = one_room(((side * 2.0, 2.7, 1.0), (0.3, 0.3, 1.0)))  # its back touches the wall
        source, head = (side * -1.0, -2.0, 1.2), (side * -1.0 + aside_m, 2.6, 1.2)
        assert loss_db(rooms, source, head).max() < 1.0


def total_db(rooms, source, head):
    """Level of the energy of all paths, the mean over the octave bands."""
    arrivals = rooms.arrivals(source, Pose(head, np.eye(3)))
    energies = np.ones((1, N_BANDS)) if arrivals.energies is None else arrivals.energies
    free = arrivals.gains**2 / (arrivals.vectors**2).sum(axis=1)
    return 10.0 * np.log10((free[:, None] * energies).sum(axis=0).mean())


@pytest.mark.parametrize("reflection", [0.3, 0.5, 0.7])
def test_the_energy_is_continuous_through_an_opening(reflection):
    """From all directions, also along the wall."""
    pair = [Room((x, -3.0, 0.0), (4.0, 6.0, 2.6), reflection) for x in (-4.05, 0.05)]
    rooms = house(WALL_PIECES, pair, 1, [DOORWAY])
    rng = np.random.default_rng(0)
    for source in rng.uniform((-3.5, -2.5, 0.3), (-0.8, 2.5, 2.0), (100, 3)):
        y, z = rng.uniform(-0.4, 0.4), rng.uniform(0.2, 1.9)
        levels = [total_db(rooms, source, np.array([x, y, z])) for x in (-1e-3, 1e-3)]
        assert abs(levels[0] - levels[1]) < 0.2
        assert total_db(rooms, np.array([1e-3, y, z]), source) == pytest.approx(
            total_db(rooms, np.array([-1e-3, y, z]), source), abs=0.2
        )


def steps_db(loss, begin, end):
    """Steps of the loss in any band on a straight way, found by bisection, and where they are."""
    found = []
    places = np.linspace(begin, end, 200)
    losses = [loss(place) for place in places]
    for low, high, before, after in zip(places, places[1:], losses, losses[1:], strict=False):
        while np.abs(after - before).max() > 0.5 and np.linalg.norm(high - low) > 1e-6:
            middle = (low + high) / 2.0
            between = loss(middle)
            if np.abs(between - before).max() > np.abs(after - between).max():
                high, after = middle, between
            else:
                low, before = middle, between
        found.append((np.abs(after - before).max(), low))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_loss_has_no_steps_where_a_head_goes_through_a_doorway(seed):
    rng = np.random.default_rng(seed)
    box = (np.array([*rng.uniform((0.9, -2.0), (3.0, 2.0)), 0.6]), rng.uniform(0.15, 0.5, 3))
    rooms = house([*WALL_PIECES, box], doorways=[DOORWAY])
    for _ in range(6):
        source = rng.uniform((-3.9, -2.9, 0.2), (-0.2, 2.9, 2.3)) * [rng.choice([-1, 1]), 1, 1]
        begin = rng.uniform((-2.0, -2.0, 0.3), (-0.5, 2.0, 1.8))
        middle = np.array([0.0, rng.uniform(-0.4, 0.4), rng.uniform(0.3, 1.8)])
        end = middle + 0.3 * (middle - begin)
        for step, place in steps_db(lambda at, one=source: loss_db(rooms, one, at), begin, end):
            in_wall = abs(place[0]) < 0.06 and abs(place[1]) > 0.49
            in_box = (np.abs(place - box[0]) < box[1] + 0.01).all()
            assert step < 1.0 or in_wall or in_box


@pytest.mark.parametrize("seed", range(4))
def test_the_loss_has_no_steps_where_furniture_is_moved_through_a_doorway(seed):
    """Of ends that are not beside the doorway."""
    rng = np.random.default_rng(seed)
    rooms = house(WALL_PIECES, doorways=[DOORWAY])
    half = np.array([*rng.uniform(0.15, 0.45, 2), 0.6])
    number = rooms.obstacles.add(half, fixed=False)
    for _ in range(4):
        source, head = rng.uniform((-3.9, -2.9, 0.2), (-1.5, 2.9, 2.3), (2, 3))
        head = head * [rng.choice([-1, 1]), 1, 1]

        def loss(at, ends=(source, head)):
            rooms.obstacles.move(number, at, np.eye(3))
            return loss_db(rooms, *ends)

        begin = np.array([-1.0, rng.uniform(-1.0, 1.0) * (0.48 - half[1]), 0.6])
        for step, place in steps_db(loss, begin, begin * [-1.0, 1.0, 1.0]):
            round_end = any((np.abs(end - place) < half + 0.02).all() for end in (source, head))
            assert step < 1.0 or round_end


@pytest.mark.parametrize("seed", range(3))
def test_source_and_head_can_be_exchanged_by_all_paths(seed):
    """In a room with a doorway, and through it into the next room, at any opening of the door."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        rooms = with_door(rng.uniform(0.0, np.pi / 2), order=1)
        one, here = rng.uniform((-3.9, -2.9, 0.1), (-0.2, 2.9, 2.5), (2, 3))
        there = rng.uniform((0.2, -2.9, 0.1), (3.9, 2.9, 2.5))
        for other in (here, there):
            there_db, back_db = total_db(rooms, one, other), total_db(rooms, other, one)
            assert there_db == pytest.approx(back_db, abs=1e-6)


def test_an_opening_without_width_takes_nothing_from_a_reflection():
    ends = np.array([-1.0, 0.3, 1.0]), Pose(np.array([-1.0, -0.3, 1.0]), np.eye(3))
    for width_m, least, most in ((1e-9, 0.99, 1.0), (50.0, 0.0, 0.5)):
        rooms = house([], order=1, doorways=[Doorway((0, 1), (0.0, 0.0), width_m, 0)])
        image = int(np.flatnonzero((image_lattice(1) == (1, 0, 0)).all(axis=1))[0])
        reflected = rooms.arrivals(*ends).energies
        left = np.ones(N_BANDS) if reflected is None else reflected[image]
        assert least <= left.min() <= left.max() <= most


def test_a_wall_reflects_little_where_a_door_is_open_and_all_where_it_is_closed():
    ends = np.array([-1.0, 0.3, 1.0]), Pose(np.array([-1.0, -0.3, 1.0]), np.eye(3))
    image = int(np.flatnonzero((image_lattice(1) == (1, 0, 0)).all(axis=1))[0])
    assert with_door(0.0, order=1).arrivals(*ends).energies is None
    reflected = with_door(np.pi / 2, order=1).arrivals(*ends).energies[image]
    assert reflected.max() < 0.7
    assert reflected[-1] < 0.1


def test_what_is_heard_of_a_door_that_opens_over_a_second_changes_no_step_by_more_than_3_db():
    rooms, silent = with_door(0.0, order=1), with_door(0.0, order=1)
    # periodic, so that the level of a step does not fluctuate
    noise = np.tile(np.random.default_rng(0).standard_normal(STEP), 40).astype(np.float32)
    levels_db = []
    for each in (rooms, silent):
        field = SoundField(each, STEP, RATE)
        source = field.add_source("noise", Clip(noise))
        listener = field.add_listener(make_receiver("hrtf"))
        field.reset(np.random.default_rng(0))
        source.position, head = (-2.0, 0.0, 1.2), Pose(np.array([2.0, 0.0, 1.2]), np.eye(3))
        heard = []
        for step in range(36):
            if each is rooms:
                turn_leaf(rooms, np.clip((step - 5) / STEPS_PER_S, 0.0, 1.0) * np.pi / 2)
            field.advance()
            heard.append(listener.render(head))
        levels_db.append([10.0 * np.log10(np.mean(sound**2) + 1e-20) for sound in heard[4:]])
    opened_db = np.subtract(*levels_db)
    assert np.abs(np.diff(opened_db)).max() < 3.0
    assert opened_db[-1] > 10.0


@pytest.mark.parametrize("seed", range(4))
def test_source_and_head_can_be_exchanged(seed):
    rng = np.random.default_rng(seed)
    for _ in range(30):
        boxes = [
            (rng.uniform((-3.0, -2.0, 0.4), (3.0, 2.0, 1.0)), rng.uniform(0.1, 0.6, 3))
            for _ in range(3)
        ]
        rooms = with_door(rng.uniform(0.0, np.pi / 2), [*WALL_PIECES, *boxes])
        one = rng.uniform((-3.9, -2.9, 0.1), (-0.1, 2.9, 2.5))
        for other in rng.uniform((0.1, -2.9, 0.1), (3.9, 2.9, 2.5), (2, 3)):
            there, back = rooms.direct_energy(one, other), rooms.direct_energy(other, one)
            np.testing.assert_allclose(there, back, rtol=1e-6)
            one = one + np.array([4.1, 0.0, 0.0])  # then in the same room


def test_another_obstacle_never_adds_energy():
    rng = np.random.default_rng(0)
    for _ in range(60):
        boxes = [
            (rng.uniform((-3.0, -2.0, 0.4), (3.0, 2.0, 1.0)), rng.uniform(0.1, 0.6, 3))
            for _ in range(4)
        ]
        ends = rng.uniform((-3.9, -2.9, 0.1), (3.9, 2.9, 2.5), (2, 3))
        energies = [one_room(*boxes[:n]).direct_energy(*ends) for n in range(5)]
        inside = [(np.abs(end - centre) < half).all() for end in ends for centre, half in boxes]
        if not any(inside):
            # boxes that touch lose some of their loss apart: 1 dB where they begin to overlap
            assert (np.diff(energies, axis=0) <= 1e-9).all()


@pytest.mark.parametrize("tilt_db", [0.0, -1.0, -3.0, -5.0])
def test_filters_have_the_levels_of_the_bands(tilt_db):
    levels_db = -5.0 + tilt_db * np.arange(N_BANDS)
    sections = shelf_filters(10.0 ** (levels_db[None] / 10.0), shelf_design(22_050))[0].astype(
        float
    )
    delay = np.exp(-2j * np.pi * BANDS_HZ / 22_050)
    response = np.prod([(b0 + b1 * delay) / (1.0 + a1 * delay) for b0, b1, a1 in sections], axis=0)
    assert np.abs(20.0 * np.log10(np.abs(response)) - levels_db).max() < 1.0
