import numpy as np
import pytest
from listening import EAR, HEAD, RATE, STEP, STILL, direction, noise, ratio_db, render_still, yaw
from refusals import naming

from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import get_spatial_audio
from veca_marl.sim.sound import SoundField

EARS = ((0.0, EAR, 0.0), (0.0, -EAR, 0.0))


def ears_of(head):
    return [head.position + head.rotation @ np.array(ear) for ear in EARS]


def test_it_equals_the_sound_field_without_latency():
    sound = noise(6 * STEP)
    source = np.array([2.1, 3.7, 1.2])
    once = get_spatial_audio(HEAD, *ears_of(HEAD), [(sound, source)])
    stream = render_still([sound], [source])
    latency = SoundField().latency_samples
    assert once.shape == (2, 6 * STEP)
    assert once.dtype == np.float32
    assert ratio_db(stream[:, latency:], once[:, :-latency]) > 100.0


def test_reflections_are_added_to_the_direct_sound():
    pulse = np.zeros(4000)
    pulse[0] = 1.0
    source = HEAD.position + np.array([-1.0, 0.5, 0.0])
    ears = ears_of(HEAD)
    free = get_spatial_audio(HEAD, *ears, [(pulse, source)])
    dead = get_spatial_audio(HEAD, *ears, [(pulse, source)], room_size=(8, 6, 3), beta=0.0)
    live = get_spatial_audio(HEAD, *ears, [(pulse, source)], room_size=(8, 6, 3), beta=0.8)
    assert ratio_db(free, dead) > 100.0
    first = int(np.abs(free).argmax(axis=1).min())
    assert np.allclose(live[:, : first + 40], free[:, : first + 40], atol=1e-4)
    assert np.abs(live[:, 1500:]).max() > 0.02
    assert np.abs(free[:, 1500:]).max() < 1e-6


def test_a_pulse_arrives_after_the_travel_time():
    pulse = np.zeros(2000)
    pulse[0] = 1.0
    heard = get_spatial_audio(STILL, *EARS, [(pulse, (3.43, 0.0, 0.0))])
    assert np.abs(heard).argmax(axis=1) == pytest.approx(0.01 * RATE, abs=3.0)


def test_several_sources_of_different_lengths():
    long, short = noise(3000, 0), noise(1000, 1)
    both = get_spatial_audio(
        STILL, *EARS, [(long, 2 * direction(30)), (short, 2 * direction(-100))]
    )
    alone = get_spatial_audio(STILL, *EARS, [(long, 2 * direction(30))])
    assert both.shape == alone.shape == (2, 3000)
    assert ratio_db(alone[:, 2000:], both[:, 2000:]) > 80.0
    assert get_spatial_audio(STILL, *EARS, []).shape == (2, 0)


def test_left_is_left_also_for_a_rotated_head():
    head = Pose(np.array([4.0, 3.0, 1.5]), yaw(np.pi / 2))
    source = head.position - np.array([1.0, 0.0, 0.0])
    heard = get_spatial_audio(head, *ears_of(head), [(noise(4000), source)])
    assert (heard[0] ** 2).sum() > 4.0 * (heard[1] ** 2).sum()


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"room_size": (0.0, 6.0, 3.0)}, ("size", "(0.0, 6.0, 3.0)")),
        ({"room_size": (-8.0, 6.0, 3.0)}, ("size", "(-8.0, 6.0, 3.0)")),
        ({"room_size": (4.0, 6.0, 3.0)}, ("head", "ears", "room")),
        ({"room_size": (5.4, 3.6, 3.0)}, ("source", "room")),
        ({"room_size": (8.0, 6.0, 3.0), "beta": 1.5}, ("beta", "1.5")),
        ({"room_size": (8.0, 6.0, 3.0), "image_order": -1}, ("order", "-1")),
    ],
)
def test_invalid_rooms_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        get_spatial_audio(HEAD, *ears_of(HEAD), [(noise(100), (2.1, 3.7, 1.2))], **numbers)


def test_invalid_positions_and_waveforms_are_refused():
    with pytest.raises(ValueError, match="ear_left"):
        get_spatial_audio(STILL, (0.0, 0.1), EARS[1], [])
    with pytest.raises(ValueError, match="source 0"):
        get_spatial_audio(STILL, *EARS, [(noise(100), (np.nan, 0.0, 0.0))])
    with pytest.raises(ValueError, match="waveform"):
        get_spatial_audio(STILL, *EARS, [(np.zeros((2, 5)), (1.0, 0.0, 0.0))])
