import numpy as np
import pytest
import scipy.signal
from listening import HEAD, RATE, ROOM_SIZE, SOURCES
from refusals import naming

from veca_marl.sim.sound import Room, room_acoustics


@pytest.mark.parametrize(("order", "count"), [(0, 1), (1, 7), (2, 25), (3, 63)])
def test_number_of_images_and_direct_sound_first(order, count):
    lattice = room_acoustics.image_lattice(order)
    assert lattice.shape == (count, 3)
    assert not lattice[0].any()
    assert len(np.unique(lattice, axis=0)) == count


def test_an_image_is_the_source_mirrored_in_the_wall():
    room = Room((-1.0, 2.0, 0.0), (4.0, 3.0, 2.5))
    lattice = room_acoustics.image_lattice(1)
    source = np.array([0.5, 3.0, 1.0])
    images = room_acoustics.image_sources(source, room.lower, room.size, lattice)
    walls = np.stack([room.lower, room.lower + room.size])
    expected = [source]
    for axis in range(3):
        for wall in walls[:, axis]:
            mirrored = source.copy()
            mirrored[axis] = 2.0 * wall - source[axis]
            expected.append(mirrored)
    assert np.allclose(sorted(images.tolist()), sorted(np.array(expected).tolist()))


def test_each_wall_has_its_own_coefficient():
    """Only the floor reflects: one image is left, below the floor."""
    floor_only = Room((0.0, 0.0, 0.0), ROOM_SIZE, (0.0, 0.0, 0.0, 0.0, 0.8, 0.0))
    lattice = room_acoustics.image_lattice(3)
    gains = room_acoustics.image_gains(floor_only.beta, lattice)
    images = room_acoustics.image_sources(SOURCES[0], floor_only.lower, floor_only.size, lattice)
    assert sorted(gains[gains > 0]) == [0.8, 1.0]
    below = images[gains == 0.8][0]
    assert np.allclose(below, SOURCES[0] * (1.0, 1.0, -1.0))


@pytest.mark.parametrize(("order", "beta"), [(0, 0.9), (1, 0.7), (2, 0.7), (3, 0.7), (10, 0.9)])
def test_image_sources_equal_pyroomacoustics(order, beta):
    reference = pytest.importorskip("pyroomacoustics")
    before = reference.constants.get("rir_hpf_enable")
    reference.constants.set("rir_hpf_enable", False)
    shoebox = reference.ShoeBox(
        ROOM_SIZE, fs=RATE, materials=reference.Material(1 - beta**2), max_order=order
    )
    shoebox.add_source(SOURCES[0])
    shoebox.add_microphone(HEAD.position)
    shoebox.compute_rir()
    reference.constants.set("rir_hpf_enable", before)
    theirs = np.asarray(shoebox.rir[0][0])[reference.constants.get("frac_delay_length") // 2 :]
    room = Room(np.zeros(3), ROOM_SIZE, beta)
    ours = room_acoustics.room_impulse_response(
        SOURCES[0], HEAD.position, room, order, RATE, len(theirs)
    )
    assert ours @ theirs / np.sqrt((ours @ ours) * (theirs @ theirs)) > 0.9999
    assert np.sqrt((theirs @ theirs) / (ours @ ours)) == pytest.approx(1.0, abs=0.005)


def decay_time(response):
    """Seconds for 60 dB, from the slope between -5 and -25 dB (Schroeder 1965; ISO 3382 T20)."""
    energy = np.cumsum(response[::-1] ** 2)[::-1]
    level = 10.0 * np.log10(energy / energy[0] + 1e-30)
    part = np.flatnonzero((level <= -5.0) & (level >= -25.0))
    return -60.0 / np.polyfit(part / RATE, level[part], 1)[0]


@pytest.mark.parametrize(
    ("size", "beta"),
    [
        ((6.0, 5.0, 3.0), 0.8),
        pytest.param((6.0, 5.0, 3.0), 0.9, marks=pytest.mark.slow),
        pytest.param((10.0, 8.0, 4.0), 0.8, marks=pytest.mark.slow),
    ],
)
def test_decay_time_lies_between_eyring_and_sabine(size, beta):
    eyring = room_acoustics.eyring_decay_time(size, beta)
    sabine = room_acoustics.sabine_decay_time(size, beta)
    n = int(1.2 * eyring * RATE)
    order = int(np.ceil(n / RATE * room_acoustics.SPEED_OF_SOUND_MPS / min(size)))
    room = Room(np.zeros(3), size, beta)
    response = room_acoustics.room_impulse_response(
        (1.3, 2.1, 1.1), (3.9, 3.2, 1.7), room, min(order, 60), RATE, n
    )
    high_pass = scipy.signal.butter(2, 100.0, "highpass", fs=RATE, output="sos")
    assert 0.9 * eyring < decay_time(scipy.signal.sosfilt(high_pass, response)) < 1.15 * sabine


def test_sabine_and_eyring_agree_for_hard_walls():
    hard = 0.999
    ratio = room_acoustics.sabine_decay_time(ROOM_SIZE, hard) / room_acoustics.eyring_decay_time(
        ROOM_SIZE, hard
    )
    assert ratio == pytest.approx(1.0, abs=2e-3)


def test_sound_falls_with_distance_but_not_within_reach_of_the_mouth():
    gain = room_acoustics.distance_gain([0.01, room_acoustics.NEAR_FIELD_M, 1.0, 2.0])
    assert gain[0] == gain[1] == 1.0 / room_acoustics.NEAR_FIELD_M
    assert gain[2:].tolist() == [1.0, 0.5]


@pytest.mark.parametrize(
    ("lower", "size", "beta", "parts"),
    [
        ((0, 0, 0), (6, 0, 3), 0.5, ("size", "(6, 0, 3)")),
        ((0, 0, 0), (6, -5, 3), 0.5, ("size", "(6, -5, 3)")),
        ((0, 0, 0), (6, np.nan, 3), 0.5, ("size", "(6, nan, 3)")),
        ((0, 0), (6, 5, 3), 0.5, ("lower", "(0, 0)")),
        ((0, 0, 0), (6, 5, 3), 1.2, ("beta", "1.2")),
        ((0, 0, 0), (6, 5, 3), -0.1, ("beta", "-0.1")),
        ((0, 0, 0), (6, 5, 3), (0.5, 0.5), ("beta", "(2,)")),
    ],
)
def test_impossible_rooms_are_refused(lower, size, beta, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        Room(lower, size, beta)


def test_negative_order_is_refused():
    with pytest.raises(ValueError, match=naming("order", "-1")):
        room_acoustics.image_lattice(-1)


def test_clamping_leaves_what_is_inside_alone():
    room = Room((-1.0, -1.0, 0.0), (2.0, 2.0, 2.0))
    inside = np.array([0.2, -0.3, 1.0])
    assert np.array_equal(room.clamp(inside), inside)
    assert np.allclose(room.clamp(np.array([5.0, -9.0, 1.0])), (0.99, -0.99, 1.0))
    assert room.contains(inside)
    assert not room.contains((1.1, 0.0, 1.0))
