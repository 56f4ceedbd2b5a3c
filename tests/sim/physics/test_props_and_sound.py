"""Walls and large boxes attenuate sound between rooms where they are now, not where they were."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import MonoReceiver
from veca_marl.sim.physics import JointCfg, PartCfg, PropCfg, PropShape, World
from veca_marl.sim.sound import SoundCfg, SoundKind

THROUGH_WALL_M, THROUGH_DOOR_M = -1.0, 1.7  # y of straight lines from one room to the other
DOOR_M = (3.05, 1.7, 1.0)
LOSS_DB = 30.0


def closing_box(**more):
    """A box that fills the doorway, at first open: beside it in the second room."""
    numbers = {"size_m": [0.05, 1.0, 2.0], "position_m": (4.0, -2.0, 1.0)} | more
    return PropCfg(name="door", shape=PropShape.box, **numbers)


class TwoRooms:
    """Two rooms, a noise in one and a listener in the other, both at `y`."""

    def __init__(self, *props, y):
        noise = SoundCfg(SoundKind.noise)
        radio = PropCfg("radio", PropShape.sphere, [0.1], (1.0, y, 1.0), sound=noise)
        self.world = World(compose(["+task=KickTheBall", "playground=two_rooms"]).playground)
        for prop in (radio, *props):
            self.world.add_prop(prop)
        self.world.freeze()
        self._listener = self.world.sound.add_listener(MonoReceiver())
        self._head = Pose(np.array([5.0, y, 1.0]), np.eye(3))
        self.reset()

    def reset(self):
        self.world.reset(np.random.default_rng(0))
        self.world.refresh()
        self._listener.render(self._head)

    def level_db(self):
        """Level of what is heard in the next steps, after the filters have been exchanged."""
        for _ in range(3):
            self._hear()
        return 10.0 * np.log10(np.mean([self._hear() ** 2 for _ in range(8)]))

    def _hear(self):
        self.world.step()
        return self._listener.render(self._head)


@pytest.fixture
def two_rooms():
    built = []

    def build(*props, y):
        built.append(TwoRooms(*props, y=y))
        return built[-1]

    yield build
    for rooms in built:
        rooms.world.close()


def test_a_wall_that_is_moved_away_no_longer_attenuates_and_a_reset_puts_it_back(two_rooms):
    rooms = two_rooms(y=THROUGH_WALL_M)
    wall = rooms.world.prop("wall_beside_door_south")
    behind_wall = rooms.level_db()
    wall.place((3.05, -20.0, 0.0))
    assert rooms.level_db() - behind_wall > 10.0  # some of it came through the door
    rooms.reset()
    assert rooms.level_db() == behind_wall


def test_a_box_in_the_doorway_attenuates_until_it_is_opened_or_reset(two_rooms):
    rooms = two_rooms(closing_box(), y=THROUGH_DOOR_M)
    door, open_db = rooms.world.prop("door"), rooms.level_db()
    for close in (lambda: door.place(DOOR_M), lambda: door.place(DOOR_M, math.pi)):
        close()
        assert open_db - rooms.level_db() == pytest.approx(LOSS_DB, abs=1.0)
    door.place((3.55, 2.2, 1.0), math.pi / 2.0)  # turned about its hinge, along the second room
    assert rooms.level_db() == pytest.approx(open_db, abs=1.0)
    door.place(DOOR_M)
    rooms.reset()
    assert rooms.level_db() == open_db


def test_a_box_that_physics_moves_out_of_the_way_no_longer_attenuates(two_rooms):
    before_the_doorway = {"size_m": [0.3, 1.0, 2.0], "position_m": (3.6, 1.7, 1.0)}
    rooms = two_rooms(closing_box(**before_the_doorway, mass_kg=5.0), y=THROUGH_DOOR_M)
    door, closed_db = rooms.world.prop("door"), rooms.level_db()
    door.set_velocity((0.0, -6.0, 0.0))
    open_db = rooms.level_db()
    assert door.position[1] < 1.0
    assert open_db - closed_db > 8.0  # it left gaps at both sides


@pytest.mark.parametrize(
    "prop",
    [
        closing_box(position_m=DOOR_M, tangible=False),
        closing_box(position_m=DOOR_M, size_m=[0.05, 0.2, 2.0]),
        closing_box(position_m=(3.05, 1.7, 1.0), size_m=[0.05, 1.0, 0.2]),
        PropCfg("door", PropShape.sphere, [0.5], DOOR_M),
    ],
    ids=["not tangible", "narrow", "low", "a sphere"],
)
def test_small_and_intangible_things_do_not_attenuate(two_rooms, prop):
    assert two_rooms(prop, y=THROUGH_DOOR_M).level_db() == two_rooms(y=THROUGH_DOOR_M).level_db()


@pytest.mark.parametrize("size_m", [[0.05, 0.6, 2.0], [0.05, 1.0, 0.9]])
def test_a_box_that_covers_a_part_of_the_doorway_attenuates_less(two_rooms, size_m):
    open_db, part_db, closed_db = (
        two_rooms(*props, y=THROUGH_DOOR_M).level_db()
        for props in (
            (),
            (closing_box(position_m=DOOR_M, size_m=size_m),),
            (closing_box(position_m=DOOR_M),),
        )
    )
    assert closed_db + 3.0 < part_db < open_db - 1.0


def test_the_leaf_of_a_hinged_door_attenuates_until_it_is_opened_or_reset(two_rooms):
    hinge = JointCfg(anchor_m=(0.0, 0.5, 0.0), range_deg=90.0)
    rooms = two_rooms(closing_box(position_m=DOOR_M, mass_kg=3.0, joint=hinge), y=THROUGH_DOOR_M)
    leaf, closed_db = rooms.world.prop("door"), rooms.level_db()
    leaf.set_opening(1.0)
    assert rooms.level_db() - closed_db == pytest.approx(LOSS_DB, abs=1.0)
    leaf.set_opening(0.0)
    assert rooms.level_db() == pytest.approx(closed_db, abs=1.0)
    leaf.set_opening(1.0)
    rooms.reset()
    assert rooms.level_db() == closed_db


def test_a_large_board_of_a_compound_attenuates_as_a_box_does(two_rooms):
    parts = [PartCfg(PropShape.box, [0.05, 1.0, 2.0]), PartCfg(PropShape.sphere, [0.04])]
    board = PropCfg("door", PropShape.compound, [], DOOR_M, parts=parts)
    closed_db = two_rooms(board, y=THROUGH_DOOR_M).level_db()
    box_db = two_rooms(closing_box(position_m=DOOR_M), y=THROUGH_DOOR_M).level_db()
    assert closed_db == pytest.approx(box_db, abs=0.1)
