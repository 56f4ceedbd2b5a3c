"""Laws of the sound field, each against an independent computation or a known limit."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.signal
from listening import (
    EAR,
    HEAD,
    OTHER_HEAD,
    RATE,
    SOURCES,
    STEP,
    STILL,
    direction,
    interaural_time,
    make_receiver,
    noise,
    ratio_db,
    render_still,
    room,
    yaw,
)
from paths import HELPERS
from refusals import naming

from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import StereoReceiver
from veca_marl.sim.sound import Clip, Noise, Silence, SoundField, Voice, room_acoustics

QUALITIES = ("hrtf", "stereo", "mono")
IN_ROOM = {"room": room(), "order": 2}
LATENCY = SoundField().latency_samples


@pytest.mark.parametrize("order", [0, 1, 2, 3])
@pytest.mark.parametrize("quality", ["stereo", "mono"])
def test_stream_equals_the_offline_room_response(order, quality):
    sound = noise(12 * STEP)
    heard = render_still([sound], SOURCES[:1], quality=quality, room=room(), order=order)
    for row, sign in ((0, 1.0), (1, -1.0)):
        ear = HEAD.position + (sign * EAR * HEAD.rotation[:, 1] if quality == "stereo" else 0.0)
        response = room_acoustics.room_impulse_response(SOURCES[0], ear, room(), order, RATE, 4000)
        expected = scipy.signal.fftconvolve(sound.astype(float), response)[: sound.size]
        assert ratio_db(expected[3000:-LATENCY], heard[row, 3000 + LATENCY :]) > 48.0


def test_hrtf_stream_equals_the_sum_over_images():
    """Each image apart, in the free field, delayed and weakened by hand; then added up."""
    sound = noise(12 * STEP)
    heard = render_still([sound], SOURCES[:1], room=room(), order=2)
    lattice = room_acoustics.image_lattice(2)
    images = room_acoustics.image_sources(SOURCES[0], room().lower, room().size, lattice)
    gains = room_acoustics.image_gains(room().beta, lattice)
    expected = sum(
        gain * render_still([sound], image[None]) for gain, image in zip(gains, images, strict=True)
    )
    assert ratio_db(expected[:, 3000:], heard[:, 3000:]) > 45.0


@pytest.mark.parametrize("quality", QUALITIES)
def test_length_of_the_step_does_not_matter(quality):
    sounds = [noise(10 * STEP, seed) for seed in (0, 1)]
    heard = render_still(sounds, SOURCES, quality=quality, **IN_ROOM)
    for step in (STEP // 2, 10 * STEP):
        other = render_still(sounds, SOURCES, quality=quality, step=step, **IN_ROOM)
        assert ratio_db(heard, other) > 110.0


@pytest.mark.parametrize("quality", QUALITIES)
def test_sounds_add_up(quality):
    sounds = [noise(6 * STEP, seed) for seed in (0, 1)]
    both = render_still(sounds, SOURCES, quality=quality, **IN_ROOM)
    apart = [
        render_still([s], p[None], quality=quality, **IN_ROOM)
        for s, p in zip(sounds, SOURCES, strict=True)
    ]
    assert ratio_db(sum(apart), both) > 110.0


def test_other_listeners_do_not_change_a_byte():
    def hear(other_qualities):
        field = SoundField(room(), STEP, RATE, 2)
        sources = [field.add_source(str(i), Noise(0.1, RATE)) for i in range(2)]
        others = [field.add_listener(make_receiver(quality)) for quality in other_qualities]
        listener = field.add_listener(make_receiver("hrtf"))
        field.reset(np.random.default_rng(1))
        heard = []
        for i in range(5):
            for source, position in zip(sources, SOURCES, strict=True):
                source.position = position + 0.02 * i
            field.advance()
            for other in others:
                other.render(OTHER_HEAD)
            heard.append(listener.render(HEAD))
        return np.concatenate(heard, axis=1).tobytes()

    assert hear(()) == hear(("hrtf", "mono", "stereo"))


def test_same_seed_same_bytes_in_a_fresh_and_in_a_used_field():
    field = SoundField(room(), STEP, RATE, 1)
    source = field.add_source("noise", Noise(0.1, RATE))
    listener = field.add_listener(make_receiver("hrtf"))

    def episode(seed):
        field.reset(np.random.default_rng(seed))
        heard = []
        for i in range(4):
            source.position = (2.0 + 0.05 * i, 3.0, 1.0)
            field.advance()
            heard.append(listener.render(Pose(HEAD.position, yaw(0.1 * i))))
        return np.concatenate(heard).tobytes()

    first = episode(7)
    assert episode(8) != first
    assert episode(7) == first


IN_ANOTHER_PROCESS = """
import hashlib
from listening import *
sounds = [noise(5 * STEP, seed) for seed in (0, 1)]
place = lambda i: (SOURCES + 0.05 * i, Pose(HEAD.position, yaw(0.1 * i)))
heard = render(sounds, place, room=room(), order=2, n_steps=5)
print(hashlib.sha256(heard.tobytes()).hexdigest())
"""


def digest_elsewhere(**environment):
    """Return what another process hears."""
    answer = subprocess.run(
        [sys.executable, "-c", IN_ANOTHER_PROCESS],
        cwd=HELPERS,
        env={**os.environ, **environment},
        capture_output=True,
        check=True,
        text=True,
    )
    return answer.stdout.split()[-1]


@pytest.mark.slow
def test_same_bytes_in_another_process_and_from_freshly_compiled_kernels(tmp_path):
    first = digest_elsewhere(PYTHONHASHSEED="1", OMP_NUM_THREADS="1")
    assert digest_elsewhere(PYTHONHASHSEED="2", OMP_NUM_THREADS="2") == first
    assert digest_elsewhere(NUMBA_CACHE_DIR=str(tmp_path)) == first
    assert digest_elsewhere(NUMBA_CACHE_DIR=str(tmp_path)) == first


@pytest.mark.parametrize("quality", QUALITIES)
def test_silence_is_exactly_zero(quality):
    assert not render_still([np.zeros(4 * STEP)], SOURCES[:1], quality=quality, **IN_ROOM).any()


def test_silence_returns_exactly_after_a_sound():
    sound = np.concatenate([noise(2 * STEP), np.zeros(10 * STEP, np.float32)])
    heard = render_still([sound], SOURCES[:1], **IN_ROOM)
    assert heard[:, : 2 * STEP].any()
    assert not heard[:, -3 * STEP :].any()


def test_the_last_echo_is_heard_to_its_end():
    """From one end of a corridor to the other, and there and back again."""
    sound = np.concatenate([noise(300), np.zeros(3700, np.float32)])
    corridor = room_acoustics.Room((0.0, 0.0, 0.0), (8.0, 1.0, 1.0), 1.0)
    head = Pose(np.array([7.9, 0.5, 0.5]), yaw(0.3))
    scene = {"quality": "mono", "room": corridor, "order": 2}
    source = [(0.1, 0.5, 0.5)]
    once = render_still([sound], source, head, step=4000, **scene)
    assert np.abs(once[:, 1550:1850]).max() > 0.01
    assert ratio_db(once, render_still([sound], source, head, step=50, **scene)) > 110.0


def test_silent_sources_do_not_change_a_byte():
    sound = noise(4 * STEP)
    silent = [np.zeros_like(sound)] * 3
    alone = render_still([sound], SOURCES[:1], **IN_ROOM)
    among = render_still([sound, *silent], [SOURCES[0], *SOURCES[[1, 1, 1]]], **IN_ROOM)
    assert alone.tobytes() == among.tobytes()


def test_a_sound_that_begins_late_is_the_same_sound():
    sound = noise(5 * STEP)
    late = np.concatenate([np.zeros(20 * STEP, np.float32), sound])
    now = render_still([sound], SOURCES[:1], **IN_ROOM)
    later = render_still([late], SOURCES[:1], **IN_ROOM)
    assert ratio_db(now, later[:, 20 * STEP :]) > 110.0


@pytest.mark.parametrize("quality", QUALITIES)
def test_doubling_the_distance_attenuates_by_six_decibels(quality):
    sound = noise(8 * STEP)
    level = [
        10.0 * np.log10(np.mean(render_still([sound], [(d, 0, 0)], STILL, quality)[:, 3000:] ** 2))
        for d in (2.0, 4.0, 8.0)
    ]
    assert np.diff(level) == pytest.approx(-6.02, abs=0.25)


def test_sound_arrives_after_its_propagation_delay():
    pulse = np.zeros(4 * STEP, np.float32)
    pulse[0] = 1.0
    for distance in (1.0, 10.0):
        heard = render_still([pulse], [(distance, 0, 0)], STILL, "mono")[0]
        expected = distance / room_acoustics.SPEED_OF_SOUND_MPS * RATE + LATENCY
        assert np.abs(heard).argmax() == pytest.approx(expected, abs=0.6)


@pytest.mark.parametrize("azimuth", [15, 45, 90, 135, 225, 270])
def test_interaural_time_is_that_of_a_head(azimuth):
    """Woodworth above 1.5 kHz, Kuhn's 3a/c sin below 0.8 kHz; positive: the left ear leads."""
    heard = render_still([noise(8 * STEP)], [2.0 * direction(azimuth)], STILL)[:, 3000:]
    lateral = np.arcsin(np.sin(np.deg2rad(azimuth)))
    travel_s = EAR / room_acoustics.SPEED_OF_SOUND_MPS
    woodworth = travel_s * (lateral + np.sin(lateral))
    assert interaural_time(heard, 1500, 5000) == pytest.approx(woodworth, abs=60e-6)
    kuhn = 3.0 * travel_s * np.sin(lateral)
    assert interaural_time(heard, 200, 800) == pytest.approx(kuhn, abs=60e-6)


@pytest.mark.parametrize("quality", QUALITIES)
def test_a_mirrored_scene_gives_mirrored_signals(quality):
    sound = noise(6 * STEP)
    mirror = np.array([1.0, -1.0, 1.0])
    box = room_acoustics.Room((-4.0, -3.0, -1.5), (8.0, 6.0, 3.0), (0.7, 0.6, 0.8, 0.5, 0.4, 0.3))
    mirrored_box = room_acoustics.Room(box.lower, box.size, box.beta[[0, 1, 3, 2, 4, 5]].tolist())
    source = np.array([1.1, 1.7, 0.3])
    here = render_still([sound], [source], STILL, quality, room=box, order=2)
    there = render_still([sound], [source * mirror], STILL, quality, room=mirrored_box, order=2)
    assert ratio_db(here[::-1], there) > 50.0


def test_mono_signals_are_equal_and_independent_of_direction():
    sound = noise(5 * STEP)
    heard = [
        render_still([sound], [2.0 * direction(azimuth)], STILL, "mono") for azimuth in (0, 110)
    ]
    assert np.array_equal(heard[0][0], heard[0][1])
    assert ratio_db(heard[0], heard[1]) > 90.0


def test_rotating_the_head_equals_rotating_the_scene():
    sound = noise(5 * STEP)
    position = 2.0 * direction(40, 20)
    here = render_still([sound], [position], STILL)
    turned = Pose(np.array([1.0, 2.0, 3.0]), yaw(1.1))
    there = render_still([sound], [turned.position + turned.rotation @ position], turned)
    assert ratio_db(here, there) > 90.0


def test_reset_clears_sound_that_is_under_way():
    field = SoundField(room(), STEP, RATE, 2)
    voice = Voice(RATE)
    field.add_source("mouth", voice).position = SOURCES[0]
    listener = field.add_listener(make_receiver("hrtf"))
    field.reset(np.random.default_rng(0))
    voice.say(noise(STEP))
    field.advance()
    assert listener.render(HEAD).any()
    field.reset(np.random.default_rng(0))
    assert not listener.render(HEAD).any()
    field.advance()
    assert not listener.render(HEAD).any()


def test_mute_and_remove():
    field = SoundField(None, STEP, RATE)
    source = field.add_source("noise", Noise(1.0, RATE))
    source.position = (2.0, 0.0, 0.0)
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))

    def hear(n_steps):
        heard = []
        for _ in range(n_steps):
            field.advance()
            heard.append(listener.render(STILL).any())
        return heard

    assert all(hear(3))
    source.muted = True
    assert not any(hear(12)[-3:])
    source.muted = False
    assert all(hear(3)[1:])
    field.remove(source)
    assert not any(hear(1))
    field.add_source("noise", Silence())
    with pytest.raises(ValueError, match=naming("source", "'noise'")):
        field.remove(source)


def test_sources_at_the_ear_and_outside_the_room_stay_finite():
    sound = noise(4 * STEP)
    for quality in QUALITIES:
        for position in (HEAD.position, (99.0, -5.0, 1.0), (0.0, 0.0, 0.0)):
            heard = render_still([sound], [position], quality=quality, **IN_ROOM)
            assert np.isfinite(heard).all()
            assert np.abs(heard).max() < 50.0


@pytest.mark.parametrize("quality", QUALITIES)
def test_sources_outside_the_room_are_heard_as_just_inside(quality):
    sound, outside = noise(4 * STEP), np.array([9.0, -0.5, 1.2])
    inside = room().clamp(outside)
    heard = [
        render_still([sound], [place], quality=quality, **IN_ROOM) for place in (outside, inside)
    ]
    assert heard[0].tobytes() == heard[1].tobytes()
    heads = [Pose(place, HEAD.rotation) for place in (outside, inside)]
    heard = [render_still([sound], SOURCES[:1], head, quality=quality, **IN_ROOM) for head in heads]
    assert heard[0].tobytes() == heard[1].tobytes()


@pytest.mark.parametrize("quality", QUALITIES)
def test_sources_are_heard_at_their_distance_up_to_the_reach(quality):
    """The distance was clipped to 60 m."""
    pulse = np.zeros(15 * STEP, np.float32)
    pulse[0] = 1.0
    heard = render_still([pulse], [(199.0, 0.0, 0.0)], STILL, quality)[0]
    assert np.abs(heard).argmax() == pytest.approx(199.0 / 343.0 * RATE + LATENCY, abs=3.0)
    with pytest.warns(UserWarning, match=naming("500 m", "reach_m=200")):
        assert not render_still([pulse], [(500.0, 0.0, 0.0)], STILL, quality).any()


def test_a_source_that_passes_the_reach_fades_without_a_click():
    tone = np.sin(2 * np.pi * 300.0 * np.arange(12 * STEP) / RATE)
    field = SoundField(None, STEP, RATE, reach_m=5.0)
    source = field.add_source("tone", Clip(tone))
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))

    def hear(step):
        source.position = (4.8 + 0.03 * step, 0.0, 0.0)
        field.advance()
        return listener.render(STILL)[0]

    near = [hear(step) for step in range(7)]
    with pytest.warns(UserWarning, match=naming("reach_m=5")):
        far = [hear(step) for step in range(7, 12)]
    heard = np.concatenate(near + far)
    assert heard[: 7 * STEP].any()
    assert not heard[-4 * STEP :].any()
    high_pass = scipy.signal.butter(8, 2000.0, "highpass", fs=RATE, output="sos")
    clicks = scipy.signal.sosfilt(high_pass, heard)[2000:]
    assert np.abs(clicks).max() < 1e-3 * np.abs(heard).max()


def test_large_rooms_have_no_limit():
    pulse = np.zeros(12 * STEP, np.float32)
    pulse[0] = 1.0
    hall = room_acoustics.Room((0.0, 0.0, 0.0), (120.0, 20.0, 10.0), 0.5)
    head = Pose(np.array([1.0, 5.0, 2.0]), np.eye(3))
    heard = render_still([pulse], [(119.0, 5.0, 2.0)], head, "mono", room=hall, order=0)[0]
    assert np.abs(heard).argmax() == pytest.approx(118.0 / 343.0 * RATE + LATENCY, abs=1.0)


def test_every_step_is_rendered_exactly_once():
    field = SoundField(None, STEP, RATE)
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))
    field.advance()
    listener.render(STILL)
    with pytest.raises(RuntimeError, match=naming("step 1", "rejoin")):
        listener.render(STILL)
    field.advance()
    field.advance()
    with pytest.raises(RuntimeError, match=naming("step 1", "step 3")):
        listener.render(STILL)
    listener.reset()
    field.advance()
    listener.render(STILL)


def test_invalid_arguments_are_refused():
    field = SoundField(None, STEP, RATE)
    source = field.add_source("ball", Silence())
    with pytest.raises(ValueError, match=naming("source", "'ball'")):
        field.add_source("ball", Silence())
    with pytest.raises(ValueError, match=naming("'ball'", "position", "nan")):
        source.position = (np.nan, 0.0, 0.0)
    with pytest.raises(ValueError, match=naming("'ball'", "position", "(0.0, 0.0)")):
        source.teleport((0.0, 0.0))
    with pytest.raises(ValueError, match=naming("step_samples")):
        SoundField(step_samples=0)
    with pytest.raises(ValueError, match=r"\bear\b"):
        StereoReceiver((0.0, 1.0), (0.0, -1.0))
