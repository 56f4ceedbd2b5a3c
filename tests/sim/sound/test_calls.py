"""Calls: their pitch, their level and what is refused."""

import numpy as np
import pytest

from veca_marl.sim.sound import CALLS, CallCfg, call_waveform

RATE = 22_050
SPOKEN = list(CALLS)


def pitch_hz(samples):
    """From the autocorrelation, between 200 and 800 Hz."""
    correlation = np.correlate(samples, samples, "full")[len(samples) - 1 :]
    lags = np.arange(RATE // 800, RATE // 200)
    return RATE / lags[np.argmax(correlation[lags])]


@pytest.mark.parametrize("call", SPOKEN)
def test_the_pitch_goes_from_the_beginning_to_the_end(call):
    cfg = CALLS[call]
    samples = call_waveform(cfg, RATE)
    assert len(samples) == round(cfg.length_s * RATE)
    tenth = len(samples) // 10
    assert pitch_hz(samples[tenth : 2 * tenth]) == pytest.approx(
        cfg.begin_hz * (cfg.end_hz / cfg.begin_hz) ** 0.15, rel=0.06
    )
    assert pitch_hz(samples[-2 * tenth : -tenth]) == pytest.approx(
        cfg.begin_hz * (cfg.end_hz / cfg.begin_hz) ** 0.85, rel=0.06
    )


@pytest.mark.parametrize("call", SPOKEN)
def test_a_call_has_its_level_and_begins_and_ends_in_silence(call):
    samples = call_waveform(CALLS[call], RATE)
    assert np.sqrt(np.mean(samples.astype(float) ** 2)) == pytest.approx(0.1, rel=0.1)
    assert abs(samples[0]) < 1e-3
    assert abs(samples[-1]) < 1e-3
    assert not samples.flags.writeable


@pytest.mark.parametrize("pitch_hz", [80.0, 9_900.0, 10_500.0, 11_000.0])
def test_a_call_of_any_possible_pitch_is_heard(pitch_hz):
    samples = call_waveform(CallCfg(pitch_hz, pitch_hz), RATE)
    assert np.sqrt(np.mean(samples.astype(float) ** 2)) == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"begin_hz": 10.0},
        {"end_hz": np.nan},
        {"end_hz": 11_025.0},
        {"length_s": 0.0},
        {"level": -1.0},
    ],
)
def test_impossible_calls_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CallCfg(**{"begin_hz": 300.0, "end_hz": 300.0, **wrong})
