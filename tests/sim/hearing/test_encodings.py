"""What the encodings of the ears' samples contain."""

import numpy as np
import pytest
from heard_scenes import Scene, tone_at
from listening import RATE

from veca_marl.sim.hearing import AudioQuality, Encoding, log_spectrum
from veca_marl.sim.hearing.encodings import (
    PHASE_LIMIT_HZ,
    Window,
    interaural_phase,
    make_encoder,
)
from veca_marl.sim.sense import check_spec
from veca_marl.sim.sound import Clip, Noise

BIN_HZ = RATE / 1024
FOLLOWED = 1.0 / (1.0 + (np.arange(250) * BIN_HZ / PHASE_LIMIT_HZ) ** 4)
SHAPES = {
    Encoding.magnitude: (2, 250),
    Encoding.magnitude_phase: (4, 250),
    Encoding.waveform: (2, 1024),
}


def noise_from(position, steps=4, **numbers):
    """Return the scene of a noise at a position, and what is heard of it."""
    scene = Scene(Noise(0.1, RATE), **numbers)
    scene.source.position = position
    return scene, scene.hear(steps)


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("quality", AudioQuality)
def test_the_encoding_and_not_the_quality_gives_the_shape(encoding, quality):
    scene, heard = noise_from((1.0, 0.5, 0.0), encoding=encoding, quality=quality)
    assert scene.sense.specs["audio"].shape == SHAPES[encoding]
    check_spec("audio", heard["audio"], scene.sense.specs["audio"])
    assert np.isfinite(heard["audio"]).all()


@pytest.mark.parametrize("encoding", Encoding)
def test_magnitudes_can_be_read_from_every_encoding(encoding):
    settings = {"noise_floor_db": -60.0, "window": Window.hann}
    _, plain = noise_from((1.0, 0.5, 0.0), encoding=Encoding.magnitude, **settings)
    scene, heard = noise_from((1.0, 0.5, 0.0), encoding=encoding, **settings)
    np.testing.assert_array_equal(scene.sense.log_magnitudes(heard["audio"]), plain["audio"])


def test_the_waveform_is_that_of_the_last_steps():
    scene = Scene(Noise(0.1, RATE), encoding=Encoding.waveform, waveform=True)
    scene.source.position = (1.0, 0.5, 0.0)
    steps = [scene.hear(1) for _ in range(4)]
    recent = np.concatenate([step["waveform"] for step in steps], axis=1)[:, -1024:]
    np.testing.assert_array_equal(steps[-1]["audio"], recent)
    assert not np.shares_memory(steps[-1]["audio"], scene.sense.read()["audio"])


@pytest.mark.parametrize("bins", [1, 250, 400, 513])
def test_bins_are_the_first_ones_of_the_transform(bins):
    _, all_bins = noise_from((1.0, 0.5, 0.0), bins=513, encoding=Encoding.magnitude_phase)
    _, some = noise_from((1.0, 0.5, 0.0), bins=bins, encoding=Encoding.magnitude_phase)
    np.testing.assert_array_equal(some["audio"], all_bins["audio"][:, :bins])


@pytest.mark.parametrize("bins", [0, -1, 514])
def test_impossible_numbers_of_bins_are_refused(bins):
    with pytest.raises(ValueError, match=f"bins={bins}"):
        Scene(Noise(0.1, RATE), bins=bins)


def test_the_phase_of_a_delayed_copy_is_its_delay():
    """A delay by n samples turns bin k by 2 pi k n / 1024: exact for a periodic signal."""
    left = np.random.default_rng(0).standard_normal(1024).astype(np.float32)
    for delay in (-9, 0, 4, 11):
        spectrum = np.fft.rfft(np.stack([left, np.roll(left, delay)]))[:, :250]
        cosine, sine = interaural_phase(spectrum)
        turned = 2.0 * np.pi * np.arange(250) * delay / 1024
        np.testing.assert_allclose(cosine, FOLLOWED * np.cos(turned), atol=1e-4)
        np.testing.assert_allclose(sine, FOLLOWED * np.sin(turned), atol=1e-4)


def test_the_phase_is_left_out_where_people_do_not_perceive_it():
    assert FOLLOWED[: int(600.0 / BIN_HZ)].min() > 0.95
    assert FOLLOWED[round(PHASE_LIMIT_HZ / BIN_HZ)] == pytest.approx(0.5, abs=0.02)
    assert FOLLOWED[int(4000.0 / BIN_HZ) :].max() < 0.02


def test_the_nearer_ear_is_ahead():
    """A source on the left: positive sine below the frequency of half a period of delay."""
    for side in (1.0, -1.0):
        for quality in (AudioQuality.stereo, AudioQuality.hrtf):
            _, heard = noise_from(
                (0.0, 2.0 * side, 0.0), encoding=Encoding.magnitude_phase, quality=quality
            )
            sine = heard["audio"][3]
            below_600_hz = slice(3, int(600.0 / BIN_HZ))
            assert (side * sine[below_600_hz] > 0.2).mean() > 0.9


def test_one_receiver_has_no_interaural_phase():
    _, heard = noise_from(
        (0.0, 2.0, 0.0), encoding=Encoding.magnitude_phase, quality=AudioQuality.mono
    )
    np.testing.assert_allclose(heard["audio"][2], FOLLOWED, atol=1e-6)
    np.testing.assert_allclose(heard["audio"][3], 0.0, atol=1e-6)


def test_silence_has_no_phase():
    scene = Scene(Clip(np.zeros(10), loop=True), encoding=Encoding.magnitude_phase)
    np.testing.assert_array_equal(scene.hear()["audio"][2:], 0.0)


def test_bins_below_the_noise_have_little_phase():
    """A tone 60 dB above the noise of its receivers: only bins near it have a phase."""
    scene = Scene(
        tone_at(47 * BIN_HZ),
        encoding=Encoding.magnitude_phase,
        noise_floor_db=-50.0,
        window=Window.hann,
        quality=AudioQuality.stereo,
    )
    scene.source.position = (1.0, 1.0, 0.0)
    weight = np.hypot(*scene.hear(6)["audio"][2:])
    assert weight[47] > 0.99 * FOLLOWED[47]
    assert weight[150:].max() < 0.1


def test_every_encoding_is_of_one_sound():
    samples = np.random.default_rng(1).standard_normal((2, 1024)).astype(np.float32)
    for encoding in Encoding:
        encoder = make_encoder(encoding, Window.rectangular, None, 250)
        heard = encoder.encode(samples)
        check_spec("audio", heard, encoder.spec)
        np.testing.assert_array_equal(encoder.log_magnitudes(heard), log_spectrum(samples))
