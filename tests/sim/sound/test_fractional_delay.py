import numpy as np
import pytest
from listening import RATE, ratio_db

from veca_marl.sim.sound.signal_paths import (
    HALF_WIDTH,
    KERNEL_TAPS,
    SignalMemory,
    farrow_coefficients,
    interpolation_kernels,
    read_moving,
)

HERTZ = 3000.0


def tone(samples):
    return np.sin(2 * np.pi * HERTZ / RATE * np.asarray(samples))


def memory_of(samples, n_samples=2000, chunk=None):
    memory = SignalMemory(n_samples)
    chunk = chunk or len(samples)
    for first in range(0, len(samples), chunk):
        memory.append(samples[first : first + chunk].astype(np.float32))
    return memory


def read(memory, before, after, n=200):
    found = np.empty(n, np.float32)
    start = memory.end - memory.n_samples
    read_moving(memory.powers, start, memory.end, before, after, found)
    return found


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5, 0.999])
def test_kernel_reads_between_two_samples(fraction):
    kernel = interpolation_kernels(np.array([fraction]))[0]
    assert kernel.sum() == pytest.approx(1.0, abs=1e-12)
    found = np.correlate(tone(np.arange(400)), kernel, "valid")
    expected = tone(np.arange(len(found)) + KERNEL_TAPS // 2 - 1 + fraction)
    assert ratio_db(expected, found) > 85.0


def test_polynomials_follow_the_kernels():
    fraction = np.linspace(0.0, 1.0, 77)
    powers = np.vander(2.0 * fraction - 1.0, len(farrow_coefficients()), increasing=True)
    assert np.abs(powers @ farrow_coefficients() - interpolation_kernels(fraction)).max() < 1e-4
    assert not farrow_coefficients().flags.writeable


@pytest.mark.parametrize("delay", [0.0, 3.0, 77.3, 100.39])
def test_read_at_a_constant_delay(delay):
    found = read(memory_of(tone(np.arange(1000))), delay, delay)
    assert ratio_db(tone(np.arange(800, 1000) - delay - HALF_WIDTH), found) > 85.0


@pytest.mark.parametrize("direction", [-1.0, 1.0])
@pytest.mark.parametrize("delay", [1e-3, 0.3, 3.7, 40.2])
def test_a_delay_that_changes_by_one_rounding_is_read_as_a_constant_one(delay, direction):
    memory = memory_of(tone(np.arange(6000)), 5500)
    constant = read(memory, delay, delay, 4410)
    changing = read(memory, delay, np.nextafter(delay, direction * np.inf), 4410)
    np.testing.assert_allclose(changing, constant, atol=1e-5)


@pytest.mark.parametrize(("before", "after"), [(100.0, 90.5), (20.0, 33.3), (40.0, 40.0 + 1e-9)])
def test_read_at_a_changing_delay(before, after):
    found = read(memory_of(tone(np.arange(1000))), before, after)
    delay = before + (after - before) * np.arange(1, 201) / 200
    assert ratio_db(tone(np.arange(800, 1000) - delay - HALF_WIDTH), found) > 85.0


def test_samples_before_the_first_are_silent():
    found = read(memory_of(np.ones(300)), 250.0, 250.0)
    assert not found[:150].any()
    assert np.allclose(found[170:], 1.0, atol=1e-5)


@pytest.mark.parametrize("chunk", [7, 882, 9000])
def test_length_of_the_parts_does_not_change_a_byte(chunk):
    """Long enough for samples to be moved to the front of the memory."""
    noise = np.random.default_rng(0).standard_normal(20_000)
    whole, parts = memory_of(noise), memory_of(noise, chunk=chunk)
    assert read(whole, 1500.0, 1490.0).tobytes() == read(parts, 1500.0, 1490.0).tobytes()


def test_samples_older_than_the_memory_are_silent():
    memory = memory_of(np.ones(5000), n_samples=100, chunk=882)
    assert not read(memory, 0.0, 0.0)[:100].any()
    assert read(memory, 0.0, 0.0)[100:].all()


def test_a_memory_that_is_extended_holds_its_samples():
    memory = memory_of(tone(np.arange(1000)), n_samples=500)
    expected = read(memory, 77.3, 77.3)
    memory.extend(3000)
    assert read(memory, 77.3, 77.3).tobytes() == expected.tobytes()
    memory.append(np.zeros(10, np.float32))
    assert read(memory, 87.3, 87.3).tobytes() == expected.tobytes()
