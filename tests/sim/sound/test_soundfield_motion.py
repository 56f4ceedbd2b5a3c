"""What moves: Doppler, no clicks, no chirps."""

import numpy as np
import pytest
import scipy.signal
from listening import RATE, STEP, STILL, make_receiver, noise, ratio_db, render, yaw

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound import Clip, SoundField, Voice, room_acoustics

LATENCY = SoundField().latency_samples


@pytest.mark.parametrize("speed", [-10.0, 10.0])
def test_doppler(speed):
    """A source straight ahead that recedes at v is heard at f (1 - v / c), up to (v / c)^2."""
    n_steps, pitch = 26, 1000.0
    sound = np.sin(2 * np.pi * pitch * np.arange(n_steps * STEP) / RATE)
    step_m = speed * STEP / RATE
    near = 1.0 if speed > 0 else 1.0 - step_m * n_steps

    def place(i):
        return [(near + step_m * (i + 1), 0.0, 0.0)], STILL

    heard = render([sound], place, "mono", n_steps=n_steps)[0, 4 * STEP : 20 * STEP]
    spectrum = np.abs(np.fft.rfft(heard * np.hanning(heard.size), 1 << 18))
    found = spectrum.argmax() * RATE / (1 << 18)
    assert found == pytest.approx(pitch * (1 - speed / room_acoustics.SPEED_OF_SOUND_MPS), abs=0.1)


def test_moving_source_equals_an_explicit_time_varying_delay():
    n_steps, speed = 16, 2.0
    n = n_steps * STEP
    sound = noise(n)

    def position(seconds):
        along = speed * (np.asarray(seconds, dtype=float) - n / RATE / 2)
        return np.stack([np.full_like(along, 1.5), along, np.full_like(along, 0.2)], axis=-1)

    def place(i):
        return position([(i + 1) * STEP / RATE]), STILL

    heard = render([sound], place, "mono", n_steps=n_steps)[0]
    time = np.arange(1, n + 1) / RATE
    distance = np.linalg.norm(position(time), axis=1)
    emitted = np.arange(n) - distance / room_acoustics.SPEED_OF_SOUND_MPS * RATE
    whole = np.rint(emitted).astype(int)
    offset = np.arange(-40, 41) - (emitted - whole)[:, None]
    kernel = np.sinc(offset) * (0.5 + 0.5 * np.cos(np.pi * np.clip(offset / 40.5, -1, 1)))
    padded = np.pad(sound.astype(float), (4000, 100))
    expected = (padded[whole[:, None] + np.arange(-40, 41) + 4000] * kernel).sum(1) / distance
    assert ratio_db(expected[2000:-LATENCY], heard[2000 + LATENCY :]) > 30.0


def test_moving_and_turning_does_not_click():
    n_steps = 12
    sound = np.sin(2 * np.pi * 300 * np.arange(n_steps * STEP) / RATE)

    def place(i):
        return [(1.5, -0.5 + 0.08 * i, 0.2)], Pose(np.zeros(3), yaw(0.12 * i))

    heard = render([sound], place, n_steps=n_steps)[:, 3000:]
    high_pass = scipy.signal.butter(8, 2000.0, "highpass", fs=RATE, output="sos")
    clicks = scipy.signal.sosfilt(high_pass, heard, axis=1)[:, 500:]
    assert 20 * np.log10(np.abs(clicks).max() / np.abs(heard).max()) < -70.0


def test_ears_that_are_deaf_to_a_source_hear_the_others_as_if_it_were_not_there():
    def hear(names, deaf_to):
        field = SoundField(None, STEP, RATE)
        for index, name in enumerate(names):
            rng = np.random.default_rng(index)
            field.add_source(name, Clip(rng.standard_normal(6 * STEP)))
        listeners = [field.add_listener(make_receiver("mono"), deaf_to=d) for d in ((), deaf_to)]
        field.reset(np.random.default_rng(0))
        for index, source in enumerate(field.sources.values()):
            source.position = (1.0 + index, 0.5, 0.0)
        heard = []
        for _ in range(6):
            field.advance()
            heard.append([listener.render(STILL) for listener in listeners])
        return np.array(heard).swapaxes(0, 1)

    every, one = hear(["voice", "beeper"], {"beeper"})
    alone, silence = hear(["voice"], {"voice"})
    assert np.array_equal(one, alone)
    assert not np.array_equal(every, alone)
    assert not silence.any()


def test_a_source_that_moved_in_silence_starts_at_its_new_position():
    """Otherwise its first word would sweep along the way it went unheard."""
    voice, word = Voice(RATE), noise(3 * STEP)
    field = SoundField(None, STEP, RATE)
    mouth = field.add_source("mouth", voice)
    listener = field.add_listener(make_receiver("mono"))

    def hear(n_steps):
        heard = []
        for _ in range(n_steps):
            field.advance()
            heard.append(listener.render(STILL))
        return np.concatenate(heard, axis=1)

    field.reset(np.random.default_rng(0))
    mouth.position = (1.0, 0.0, 0.0)
    voice.say(word)
    assert not hear(20)[:, -STEP:].any()
    mouth.position = (2.5, 0.0, 0.0)
    voice.say(word)
    moved = hear(4)
    field.reset(np.random.default_rng(0))
    voice.say(word)
    assert ratio_db(hear(4), moved) > 110.0


@pytest.mark.parametrize("how", ["teleport", "too fast to fly"])
def test_a_teleport_gives_neither_a_chirp_nor_a_click(how):
    """Flying 1.5 m in a step would shift 1 kHz by 110 Hz; a jump leaves the pitch alone."""
    far = 2.5 if how == "teleport" else 7.0
    field = SoundField(None, STEP, RATE)
    sound = np.sin(2 * np.pi * 1000 * np.arange(12 * STEP) / RATE)
    source = field.add_source("tone", Clip(sound))
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))
    source.position = (1.0, 0.0, 0.0)
    heard = []
    for i in range(12):
        if i == 8:
            if how == "teleport":
                source.teleport((far, 0.0, 0.0))
            else:
                source.position = (far, 0.0, 0.0)
        field.advance()
        heard.append(listener.render(STILL)[0])
    jump = np.concatenate(heard)[7 * STEP : 10 * STEP]
    high_pass = scipy.signal.butter(8, 3000.0, "highpass", fs=RATE, output="sos")
    assert np.abs(scipy.signal.sosfilt(high_pass, jump)[500:]).max() < 1e-3
    frequency = np.fft.rfftfreq(STEP, 1.0 / RATE)
    spectrum = np.abs(np.fft.rfft(heard[8] * np.hanning(STEP)))
    shifted = spectrum[np.abs(frequency - 890) < 26].max() + spectrum[frequency > 1090][:3].max()
    assert shifted < 0.1 * spectrum[np.abs(frequency - 1000) < 30].max()
