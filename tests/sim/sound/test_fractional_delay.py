import numpy as np
import pytest
from listening import RATE, ratio_db

from veca_marl.sim.sound import KERNEL_TAPS, fractional_kernel, kernel_bank
from veca_marl.sim.sound.fractional_delay import HALF_WIDTH, KERNEL_LATENCY, PHASES, read_delayed

HERTZ = 3000.0


def tone(samples):
    return np.sin(2 * np.pi * HERTZ / RATE * np.asarray(samples))


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5, 100.5 / PHASES, 0.999])
def test_kernel_delays_by_its_fraction(fraction):
    kernel = np.empty(KERNEL_TAPS, np.float32)
    fractional_kernel(kernel_bank(), fraction, kernel)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-6)
    found = np.convolve(tone(np.arange(400)), kernel)[50:350]
    expected = tone(np.arange(50, 350) - KERNEL_LATENCY - fraction)
    assert ratio_db(expected, found) > 85.0


@pytest.mark.parametrize("delay", [0.0, 3.0, 77.3, 100 + 100.5 / PHASES])
def test_standing_read(delay):
    history = tone(np.arange(1000)).astype(np.float32)
    found = np.empty(200, np.float32)
    read_delayed(history, delay, delay, kernel_bank(), found)
    assert ratio_db(tone(np.arange(800, 1000) - delay - HALF_WIDTH), found) > 85.0


@pytest.mark.parametrize(("before", "after"), [(100.0, 90.5), (20.0, 33.3)])
def test_moving_read(before, after):
    history = tone(np.arange(1000)).astype(np.float32)
    found = np.empty(200, np.float32)
    read_delayed(history, before, after, kernel_bank(), found)
    delay = before + (after - before) * np.arange(1, 201) / 200
    assert ratio_db(tone(np.arange(800, 1000) - delay - HALF_WIDTH), found) > 85.0


def test_before_the_history_there_is_silence():
    found = np.empty(200, np.float32)
    read_delayed(np.ones(300, np.float32), 250.0, 250.0, kernel_bank(), found)
    assert not found[:150].any()
    assert np.allclose(found[170:], 1.0, atol=1e-5)


def test_bank_is_shared_and_read_only():
    assert kernel_bank() is kernel_bank()
    assert not kernel_bank().flags.writeable
