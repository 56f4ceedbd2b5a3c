import math

import numpy as np
import pytest
from heard_scenes import Dummy, Scene, buzz_at, tone_at
from listening import EAR, RATE, STEP, noise, yaw
from refusals import naming
from stand_in_worlds import SoundWorld

from veca_marl.sim.hearing import AudioCfg, AudioQuality, AudioSense, Encoding, Window
from veca_marl.sim.hearing.hrtf import kemar_response
from veca_marl.sim.sense import check_spec
from veca_marl.sim.sound import Clip, Noise, SoundField


@pytest.mark.parametrize("quality", AudioQuality)
@pytest.mark.parametrize("waveform", [False, True])
def test_quality_changes_the_content_but_not_the_shape(quality, waveform):
    scene = Scene(buzz_at(150.0), quality=quality, waveform=waveform)
    scene.source.position = (1.0, 1.0, 0.0)
    observation = scene.hear()
    assert set(observation) == set(scene.sense.specs)
    assert ("waveform" in observation) == waveform
    assert scene.sense.specs["audio"].shape == (2, 250)
    for name, value in observation.items():
        check_spec(name, value, scene.sense.specs[name])
        assert np.isfinite(value).all()


def test_the_observation_is_the_formula_of_the_paper():
    scene = Scene(Noise(0.1, RATE), waveform=True)
    scene.source.position = (1.0, 0.5, 0.0)
    heard = np.concatenate([scene.hear(1)["waveform"] for _ in range(3)], axis=1)
    scene.reset()
    expected = np.log10(np.abs(np.fft.rfft(heard[:, -1024:])) + 1e-8)[:, :250]
    assert np.allclose(scene.hear(3)["audio"], expected, atol=1e-3)


def test_silence_is_minus_eight_also_before_the_first_step():
    scene = Scene(Clip(np.zeros(10), loop=True))
    assert scene.sense.specs["audio"].low == -8.0
    assert (scene.sense.read()["audio"] == -8.0).all()
    assert (scene.hear()["audio"] == -8.0).all()


def test_the_noise_floor_sets_the_level_of_silence():
    """White noise of level -80 dB has 10 log10(1024) - 80 dB in each bin, on average."""
    scene = Scene(Clip(np.zeros(10), loop=True), noise_floor_db=-80.0)
    expected = 0.5 * np.log10(1024) - 4.0
    assert np.allclose(scene.hear()["audio"], expected, atol=1e-4)
    loud, floored = (
        Scene(Noise(0.1, RATE), noise_floor_db=floor_db).hear()["audio"]
        for floor_db in (None, -80.0)
    )
    assert np.allclose(loud, floored, atol=1e-3)


def test_the_hann_window_reduces_leakage():
    far = {}
    for window in Window:
        scene = Scene(tone_at(1010.0), window=window, quality=AudioQuality.mono)
        scene.source.position = (1.0, 0.0, 0.0)
        audio = scene.hear()["audio"][0]
        assert audio.argmax() == 47
        far[window] = audio.max() - audio[150:].max()
    assert far[Window.hann] > far[Window.rectangular] + 2.0


def test_a_source_at_one_metre_has_its_own_level():
    """A tone on a bin: magnitude = amplitude x 1024 / 2."""
    frequency = 47 * RATE / 1024
    sound = 0.1 * np.sqrt(2) * np.sin(2 * np.pi * frequency * np.arange(4 * STEP) / RATE)
    scene = Scene(Clip(sound), quality=AudioQuality.mono)
    scene.source.position = scene.body.mount("ear_left").position + np.array([1.0, -EAR, 0.0])
    peak = scene.hear()["audio"][0, 47]
    assert peak == pytest.approx(np.log10(0.1 * np.sqrt(2) * 512), abs=0.002)


@pytest.mark.parametrize("scale", [1.0, 0.733])
def test_stereo_receives_at_the_ears_of_a_head_of_that_size(scale):
    """The level at each ear is inversely proportional to its own distance."""
    sound = Clip(noise(9 * STEP))
    scene = Scene(sound, quality=AudioQuality.stereo, waveform=True, head_scale=scale)
    scene.body.rotation = yaw(0.5)
    scene.body.position = np.array([3.0, -1.0, 0.5])
    scene.source.position = (3.2, -0.7, 0.6)
    ears = np.array([scene.body.mount(f"ear_{side}").position for side in ("left", "right")])
    left = scale * kemar_response().head_radius_m * scene.body.rotation[:, 1]
    at_ears = ears.mean(axis=0) + np.array([left, -left])
    distance = np.linalg.norm(scene.source.position - at_ears, axis=1)
    heard = np.concatenate([scene.hear(1)["waveform"] for _ in range(8)], axis=1)[:, 500:]
    level = np.sqrt(np.mean(heard**2, axis=1))
    assert level[0] / level[1] == pytest.approx(distance[1] / distance[0], rel=0.01)


def test_the_rotation_of_the_head_at_construction_has_no_influence():
    heard = []
    for initial in (0.0, 2.0):
        body = Dummy()
        body.rotation = yaw(initial)
        field = SoundField(None, STEP, RATE)
        field.add_source("noise", Noise(0.1, RATE)).position = (0.4, 0.5, 0.0)
        sense = AudioSense(AudioCfg(quality=AudioQuality.stereo), body, SoundWorld(field))
        body.rotation = yaw(0.5)
        field.reset(np.random.default_rng(0))
        sense.reset()
        field.advance()
        heard.append(sense.read()["audio"])
    assert np.allclose(heard[0], heard[1], atol=1e-3)


def test_the_ear_on_the_side_of_the_source_is_louder():
    for quality in (AudioQuality.hrtf, AudioQuality.stereo):
        scene = Scene(buzz_at(150.0), quality=quality)
        scene.source.position = (0.0, 1.0, 0.0)
        left, right = scene.hear()["audio"].mean(axis=1)
        assert left > right + 0.03


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e9, 200.1, -200.1])
def test_a_noise_floor_that_is_no_level_is_refused(wrong):
    with pytest.raises(ValueError, match=naming("noise_floor_db", str(wrong), "-200", "200")):
        AudioCfg(noise_floor_db=wrong)


@pytest.mark.parametrize("floor_db", [-200.0, 200.0])
@pytest.mark.parametrize("encoding", Encoding)
def test_observations_are_finite_at_the_greatest_and_least_noise_floor(floor_db, encoding):
    scene = Scene(Noise(0.1, RATE), noise_floor_db=floor_db, encoding=encoding)
    assert np.isfinite(scene.hear()["audio"]).all()


def test_invalid_settings_are_refused():
    with pytest.raises(ValueError, match=naming("sofa_sample_rate_hz", "44100.0", "sofa_path")):
        AudioCfg(sofa_sample_rate_hz=44_100.0)
    with pytest.raises(ValueError, match=naming("senses.audio.window='hann'", "rectangular")):
        AudioCfg(window="hann")
    with pytest.raises(ValueError, match=naming("senses.audio.quality='mono'", "hrtf", "stereo")):
        AudioCfg(quality="mono")
    with pytest.raises(ValueError, match="nowhere"):
        Scene(buzz_at(150.0), sofa_path="nowhere.sofa")


def test_the_own_voice_has_the_level_at_the_distance_of_the_mouth():
    """Mouth and ears of the body, not a constant, set the least distance."""
    for depth in (0.08, 0.2):
        scene = Scene(Clip(noise(9 * STEP)), quality=AudioQuality.mono, waveform=True)
        ear = np.array([-0.01, EAR, 0.02])
        mouth = np.array([depth, 0.0, -0.02])
        scene.body.mouth = mouth
        scene.sense = AudioSense(
            AudioCfg(quality=AudioQuality.mono, waveform=True), scene.body, SoundWorld(scene.field)
        )
        levels = []
        for position in (np.array([-0.01, 0.0, 0.02]), np.array([0.99, 0.0, 0.02])):
            scene.source.position = position
            scene.reset()
            heard = np.concatenate([scene.hear(1)["waveform"] for _ in range(8)], axis=1)
            levels.append(np.sqrt(np.mean(heard[0, 500:] ** 2)))
        assert levels[0] / levels[1] == pytest.approx(1.0 / np.linalg.norm(mouth - ear), rel=0.02)
