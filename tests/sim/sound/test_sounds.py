import numpy as np
import pytest
import scipy.io.wavfile
import scipy.signal
from listening import RATE, STEP
from refusals import naming

from veca_marl.sim.sound import (
    Clip,
    Noise,
    Pulses,
    Silence,
    SoundCfg,
    SoundKind,
    Voice,
    make_sound,
    waveforms,
)


def emit(sound, n_steps=50, seed=0):
    sound.reset(np.random.default_rng(seed))
    return np.concatenate([sound.emit(STEP) for _ in range(n_steps)])


def rms(samples):
    return np.sqrt(np.mean(np.square(samples, dtype=np.float64)))


@pytest.mark.parametrize("kind", [SoundKind.buzz, SoundKind.tone, SoundKind.noise])
def test_level_is_the_rms_pressure_at_one_metre(kind):
    samples = emit(make_sound(SoundCfg(kind, frequency_hz=200.0, level=0.3)))
    assert samples.dtype == np.float32
    assert rms(samples) == pytest.approx(0.3, rel=0.02)


def test_buzz_has_all_harmonics_of_the_observed_band_and_nothing_else():
    spectrum = np.abs(np.fft.rfft(emit(Clip(waveforms.buzz(150.0, 0.1, RATE), loop=True), 25)))
    harmonics = spectrum[150:5400:150]
    assert harmonics.min() > 0.1 * harmonics.max()
    between = np.delete(spectrum, np.arange(0, len(spectrum), 150))
    assert between.max() < 1e-3 * harmonics.max()


def test_buzz_has_a_low_peak_factor():
    assert np.abs(waveforms.buzz(150.0, 0.1, RATE)).max() < 0.35


def test_loops_are_continuous():
    loop = waveforms.tone(441.0, 1.0, RATE)
    bend = np.abs(np.diff(np.concatenate([loop[-2:], loop]), 2))
    assert bend[:2].max() < 1.001 * bend[2:].max()


@pytest.mark.parametrize("kind", [SoundKind.buzz, SoundKind.noise])
def test_same_seed_same_bytes(kind):
    first, again = (emit(make_sound(SoundCfg(kind)), seed=3) for _ in range(2))
    assert first.tobytes() == again.tobytes()
    assert emit(make_sound(SoundCfg(kind)), seed=4).tobytes() != first.tobytes()


def test_noise_is_white_above_the_high_pass():
    spectrum = np.abs(np.fft.rfft(emit(Noise(1.0, RATE), 200))) ** 2
    hertz = np.fft.rfftfreq(200 * STEP, 1.0 / RATE)
    low = spectrum[hertz < 20.0].mean()
    middle = spectrum[(hertz > 500) & (hertz < 1500)].mean()
    high = spectrum[(hertz > 5000) & (hertz < 10000)].mean()
    assert high / middle == pytest.approx(1.0, abs=0.05)
    assert low < 1e-2 * middle


@pytest.mark.parametrize("kind", [SoundKind.buzz, SoundKind.noise])
def test_pulses_are_the_sound_with_exact_silence_between_them(kind):
    pulsed = SoundCfg(kind, level=0.3, pulse_s=0.1, pause_s=0.3)
    samples = emit(make_sound(pulsed), 100).reshape(-1, round(0.4 * RATE))  # a pulse in each row
    heard = np.any(samples != 0.0, axis=0)
    assert abs(heard.sum() - 0.1 * RATE) <= 2
    np.testing.assert_array_equal(samples[:, ~heard], 0.0)
    begin = np.flatnonzero(heard & ~np.roll(heard, 1))[0]
    pulses = np.roll(samples, -begin, axis=1)[:, : round(0.1 * RATE)]
    ramp = round(0.005 * RATE)
    assert rms(pulses[:, ramp:-ramp]) == pytest.approx(0.3, rel=0.05)
    assert rms(pulses[:, :20]) < 0.06 * 0.3


def test_pulses_have_no_clicks():
    beeps = SoundCfg(SoundKind.tone, frequency_hz=2000.0, level=1.0, pulse_s=0.1, pause_s=0.1)
    spectrum = np.abs(np.fft.rfft(emit(make_sound(beeps), 50)))
    frequency = np.fft.rfftfreq(2 * (len(spectrum) - 1), 1.0 / RATE)
    far = np.abs(frequency - 2000.0) > 1000.0
    assert (spectrum[far] ** 2).sum() < 1e-5 * (spectrum**2).sum()


def test_pulses_do_not_depend_on_the_length_of_a_step():
    sound = make_sound(SoundCfg(SoundKind.buzz, pulse_s=0.05, pause_s=0.02))
    whole = emit(sound, 10)
    sound.reset(np.random.default_rng(0))
    np.testing.assert_array_equal([sound.emit(1)[0] for _ in range(200)], whole[:200])


@pytest.mark.parametrize(
    ("pulse_s", "pause_s", "wrong"),
    [
        (0.0, 1.0, "pulse_s=0.0"),
        (np.inf, 1.0, "pulse_s=inf"),
        (0.2, -1.0, "pause_s=-1.0"),
        (0.2, np.inf, "pause_s=inf"),
        (np.nan, 1.0, "pulse_s=nan"),
    ],
)
def test_impossible_pulses_are_refused(pulse_s, pause_s, wrong):
    with pytest.raises(ValueError, match=naming(wrong)):
        SoundCfg(pulse_s=pulse_s, pause_s=pause_s)
    with pytest.raises(ValueError, match=naming(wrong)):
        Pulses(Silence(), pulse_s, pause_s)


def test_a_voice_has_no_pulses():
    with pytest.raises(ValueError, match=naming("voice", "pause_s=0.5")):
        SoundCfg(SoundKind.voice, pause_s=0.5)


def test_noise_must_be_reset_before_it_emits():
    with pytest.raises(RuntimeError, match="reset"):
        Noise(1.0, RATE).emit(STEP)


def test_clip_plays_once_and_falls_silent():
    waveform = np.arange(1, STEP + 101, dtype=np.float32)
    clip = Clip(waveform)
    for _ in range(2):
        played = emit(clip, 3)
        assert np.array_equal(played[: waveform.size], waveform)
        assert not played[waveform.size :].any()


def test_a_looping_clip_starts_at_a_random_position():
    waveform = np.arange(100, dtype=np.float32)
    played = emit(Clip(waveform, loop=True), 2)
    assert np.array_equal(played, (played[0] + np.arange(2 * STEP)) % 100)
    starts = {float(emit(Clip(waveform, loop=True), 1, seed)[0]) for seed in range(5)}
    assert len(starts) > 1


def spoken(*utterances, n_steps=8):
    """Speak utterances that are appended at once."""
    voice = Voice(RATE)
    voice.reset(np.random.default_rng(0))
    for utterance in utterances:
        voice.say(utterance)
    return np.concatenate([voice.emit(STEP) for _ in range(n_steps)])


def test_voice_speaks_in_order_then_falls_silent():
    first, second = np.random.default_rng(0).standard_normal((2, 700))
    heard = spoken(first, second)
    expected = scipy.signal.sosfilt(waveforms.high_pass(RATE), np.append(first, second))
    assert np.array_equal(heard[:1400], expected.astype(np.float32))
    assert not heard[-STEP:].any()


def test_a_cleared_voice_emits_only_the_decay_of_the_high_pass():
    voice = Voice(RATE)
    voice.say(np.random.default_rng(0).standard_normal(2 * STEP))
    voice.emit(STEP)
    voice.clear()
    assert not voice.speaking
    assert np.abs(voice.emit(4 * STEP)[3 * STEP :]).max() < 1e-6
    voice.say(np.ones(STEP))
    voice.reset(np.random.default_rng(0))
    assert not voice.emit(STEP).any()


@pytest.mark.parametrize("parts", [2, 7, 40])
@pytest.mark.parametrize("shape", ["ramp", "constant", "noise", "low tone", "pulse"])
def test_speech_in_parts_equals_speech_at_once(shape, parts):
    """The high-pass keeps its state from one part to the next."""
    time = np.arange(4 * STEP) / RATE
    waveform = {
        "ramp": time,
        "constant": np.ones_like(time),
        "noise": np.random.default_rng(1).standard_normal(time.size),
        "low tone": np.sin(2 * np.pi * 60.0 * time),
        "pulse": (time == 0.0).astype(float),
    }[shape]
    assert np.array_equal(spoken(*np.array_split(waveform, parts)), spoken(waveform))


def test_speech_appended_step_by_step_equals_speech_at_once():
    waveform = np.random.default_rng(2).standard_normal(5 * STEP) + 1.0
    voice, heard = Voice(RATE), []
    for i in range(8):
        voice.say(waveform[i * STEP : (i + 1) * STEP])
        heard.append(voice.emit(STEP))
    assert np.array_equal(np.concatenate(heard), spoken(waveform))


@pytest.mark.parametrize("duration_s", [0.004, 0.5])
def test_a_looping_file_has_no_transient_at_its_seam(tmp_path, duration_s):
    """A constant pressure has no sound, also where its repetition begins."""
    samples = np.full(round(duration_s * RATE), 12_000, np.int16)
    scipy.io.wavfile.write(tmp_path / "constant.wav", RATE, samples)
    loop = waveforms.load_wav(tmp_path / "constant.wav", RATE, loop=True)
    assert loop.size == samples.size
    assert np.abs(loop).max() < 1e-5
    assert np.abs(waveforms.load_wav(tmp_path / "constant.wav", RATE)).max() > 0.1


@pytest.mark.parametrize("rate", [RATE, 44_100, 48_000, 16_000])
def test_a_looping_tone_of_any_rate_continues_at_its_seam(tmp_path, rate):
    """A second of whole periods, repeated, is the tone itself."""
    tone = 0.5 * np.sin(2.0 * np.pi * 500.0 * np.arange(rate) / rate)
    scipy.io.wavfile.write(tmp_path / "tone.wav", rate, tone.astype(np.float32))
    loop = waveforms.load_wav(tmp_path / "tone.wav", RATE, loop=True)
    phases = 2.0 * np.pi * 500.0 * np.arange(loop.size) / RATE
    basis = np.stack([np.sin(phases), np.cos(phases)], axis=1)  # the high-pass shifts the phase
    expected = basis @ np.linalg.lstsq(basis, loop.astype(float), rcond=None)[0]
    assert np.abs(loop - expected).max() < 1e-3


def test_levels_beyond_any_sound_are_refused():
    with pytest.raises(ValueError, match=naming("level", "1e+39", "1e+06")):
        Noise(1e39, RATE)


def test_voice_filters_out_constant_pressure():
    voice = Voice(RATE)
    voice.say(np.ones(RATE))
    assert np.abs(voice.emit(RATE)[RATE // 4 :]).max() < 1e-6


@pytest.mark.parametrize("bad", [np.ones((2, 100)), [np.nan], [np.inf, 0.0], [1e39]])
def test_bad_waveforms_are_refused(bad):
    with pytest.raises(ValueError, match="waveform"):
        Voice(RATE).say(bad)
    with pytest.raises(ValueError, match="waveform"):
        Clip(bad)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.int32, np.float32])
def test_wav_files_are_resampled_mixed_and_scaled(tmp_path, dtype):
    rate = 44_100
    sine = 0.5 * np.sin(2 * np.pi * 1000 * np.arange(rate) / rate)
    if dtype == np.uint8:
        samples = np.round(sine * 128 + 128).astype(dtype)
    elif dtype == np.float32:
        samples = sine.astype(dtype)
    else:
        samples = np.round(sine * np.iinfo(dtype).max).astype(dtype)
    scipy.io.wavfile.write(tmp_path / "sine.wav", rate, np.stack([samples, samples], axis=1))
    own = waveforms.load_wav(tmp_path / "sine.wav", RATE)
    assert own.size == RATE
    assert rms(own[2000:-2000]) == pytest.approx(0.5 / np.sqrt(2), rel=0.02)
    assert np.abs(np.fft.rfft(own)).argmax() == 1000
    cfg = SoundCfg(SoundKind.clip, level=0.05, path=str(tmp_path / "sine.wav"))
    assert rms(emit(make_sound(cfg))) == pytest.approx(0.05, rel=0.02)


def test_invalid_wav_files_are_refused(tmp_path):
    (tmp_path / "page.wav").write_text("<html>404</html>")
    with pytest.raises(ValueError, match=r"page\.wav"):
        waveforms.load_wav(tmp_path / "page.wav", RATE)
    scipy.io.wavfile.write(tmp_path / "empty.wav", RATE, np.zeros(0, np.int16))
    with pytest.raises(ValueError, match=r"empty\.wav"):
        waveforms.load_wav(tmp_path / "empty.wav", RATE, loop=True)
    scipy.io.wavfile.write(tmp_path / "mute.wav", RATE, np.zeros(100, np.int16))
    with pytest.raises(ValueError, match=naming("mute.wav", "0.1")):
        waveforms.load_wav(tmp_path / "mute.wav", RATE, level=0.1)


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"frequency_hz": 20.0}, ("frequency_hz=20.0", "80")),
        ({"frequency_hz": np.nan}, ("frequency_hz=nan", "80")),
        ({"frequency_hz": 11_025.0}, ("frequency_hz=11025.0", "80")),
        ({"frequency_hz": 12_000.0, "kind": SoundKind.tone}, ("frequency_hz=12000.0", "11025")),
        ({"frequency_hz": 1e9}, ("frequency_hz=1000000000.0", "11025")),
        ({"level": -1.0}, ("level", "-1.0")),
        ({"kind": SoundKind.clip}, ("clip", "path=None")),
        ({"path": "a.wav"}, ("buzz", "path='a.wav'")),
    ],
)
def test_impossible_sounds_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        SoundCfg(**numbers)


def test_pitch_above_the_band_is_refused():
    with pytest.raises(ValueError, match="frequency_hz=12000"):
        waveforms.tone(12_000.0, 0.1, RATE)


def test_every_kind_can_be_made(tmp_path):
    scipy.io.wavfile.write(tmp_path / "a.wav", RATE, np.ones(100, np.int16) * 99)
    for kind in SoundKind:
        path = str(tmp_path / "a.wav") if kind is SoundKind.clip else None
        assert emit(make_sound(SoundCfg(kind, path=path)), 2).shape == (2 * STEP,)
    assert not emit(Silence()).any()


def test_a_wav_file_that_is_cut_off_is_refused_at_any_length(tmp_path):
    scipy.io.wavfile.write(tmp_path / "tone.wav", RATE, np.ones(8, np.float32))
    whole = (tmp_path / "tone.wav").read_bytes()
    for length in range(len(whole) - 32):
        cut = tmp_path / "cut.wav"
        cut.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=naming("cut.wav")):
            waveforms.load_wav(cut, RATE)


def test_a_wav_file_with_samples_that_are_not_finite_is_refused(tmp_path):
    samples = np.array([0.1, np.nan, 0.2], np.float32)
    scipy.io.wavfile.write(tmp_path / "nan.wav", RATE, samples)
    with pytest.raises(ValueError, match=naming("nan.wav", "finite")):
        waveforms.load_wav(tmp_path / "nan.wav", RATE)


def test_a_missing_wav_file_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=naming("none.wav")):
        waveforms.load_wav(tmp_path / "none.wav", RATE)
