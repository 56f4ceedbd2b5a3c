import numpy as np
import pytest

from tools.fidelity.hearing import rooms
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS, House, Room

ROOM = Room(np.zeros(3), rooms.ROOM_M, rooms.UNEQUAL_WALLS)


@pytest.mark.parametrize("order", [0, 1, 4])
def test_image_sources_are_those_of_repeated_mirroring(order):
    assert rooms.lattice_error_m(order) < 1e-9


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_stream_equals_exact_delays(order):
    assert rooms.stream_error_db(order) < -45.0


def pyroomacoustics_response(size, beta):
    """The impulse response of a room by another program with image sources."""
    reference = pytest.importorskip("pyroomacoustics")
    order, n_samples = rooms.extent(size, beta)
    shoebox = reference.ShoeBox(
        size, fs=rooms.SAMPLE_RATE_HZ, materials=reference.Material(1 - beta**2), max_order=order
    )
    shoebox.set_sound_speed(SPEED_OF_SOUND_MPS)
    shoebox.add_source(rooms.REVERBERANT_SOURCE)
    shoebox.add_microphone(rooms.REVERBERANT_HEAD)
    shoebox.compute_rir()
    latency = reference.constants.get("frac_delay_length") // 2
    return np.asarray(shoebox.rir[0][0])[latency : latency + n_samples]


@pytest.mark.parametrize(
    "number", [pytest.param(0, marks=pytest.mark.slow), pytest.param(1, marks=pytest.mark.slow), 2]
)
def test_reverberation_is_that_of_pyroomacoustics(number):
    case = rooms.REVERBERANT[number]
    reference_s = rooms.reverberation_time(pyroomacoustics_response(*case))
    assert rooms.REFERENCE_S[number] == pytest.approx(reference_s, abs=1e-3)
    assert rooms.reference_law(*case, rooms.reverberation(*case)[0], reference_s).holds
    assert not rooms.reference_law(*case, 1.02 * reference_s, reference_s).holds


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
    assert house.direct_energy(one, other)[-1] < 0.2
    assert rooms.reciprocity_error_db(house, one, other, 1) < -80.0
