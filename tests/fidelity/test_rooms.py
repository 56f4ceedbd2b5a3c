import numpy as np
import pytest

from veca_marl.fidelity.hearing import rooms
from veca_marl.sim.sound import House, Room

ROOM = Room(np.zeros(3), rooms.ROOM_M, rooms.UNEQUAL_WALLS)


@pytest.mark.parametrize("order", [0, 1, 4])
def test_image_sources_are_those_of_repeated_mirroring(order):
    assert rooms.lattice_error_m(order) < 1e-9


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_stream_equals_exact_delays(order):
    assert rooms.stream_error_db(order) < -45.0


def test_levels_fall_with_the_distance():
    levels = rooms.level_over_distance([0.25, 1.0, 16.0])
    assert levels == pytest.approx([12.04, 0.0, -24.08], abs=0.1)


def test_source_and_receiver_can_be_exchanged():
    one, other = np.array(rooms.SOURCE), np.array(rooms.HEAD)
    assert rooms.reciprocity_error_db(ROOM, one, other, 2) < -80.0


def test_source_and_receiver_can_be_exchanged_between_obstacles():
    house = House([ROOM], image_order=1)
    for centre in ((3.5, 3.0, 1.0), (4.5, 1.0, 1.0)):
        number = house.obstacles.add((0.3, 0.8, 1.0))
        house.obstacles.move(number, centre, np.eye(3))
    one, other = np.array([2.1, 3.7, 0.7]), np.array([5.3, 2.2, 0.9])
    assert house.obstacles_between(one, other) == 1
    assert rooms.reciprocity_error_db(house, one, other, 1) < -80.0
