"""Arrays that are packed are read back; damaged ones are refused."""

import numpy as np
import pytest

from veca_marl.runs.episode_page.packing import Packer, PackingError, unpack

UNIT = 1e-4


def packed(**arrays):
    packer = Packer()
    for name, array in arrays.items():
        packer.add_quantised(name, array, UNIT)
    return packer


@pytest.mark.parametrize("shape", [(1, 3), (500, 47, 3), (7,), (0, 4), (5, 0, 3)])
def test_quantised_arrays_are_read_back_within_half_a_unit(shape):
    values = np.random.default_rng(0).normal(scale=20.0, size=shape)
    packer = packed(a=np.zeros((2, 2)), walk=values)
    read = unpack(packer.entries, packer.block, "walk")
    assert read.shape == shape
    np.testing.assert_allclose(read, values, atol=0.5001 * UNIT)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.int32, np.float32])
def test_plain_arrays_are_read_back_exactly(kind):
    values = np.arange(24).reshape(4, 6).astype(kind)
    packer = Packer()
    packer.add_media("picture", b"\x00\xff")
    packer.add_plain("values", values)
    read = unpack(packer.entries, packer.block, "values")
    assert read.dtype == kind
    np.testing.assert_array_equal(read, values)
    assert unpack(packer.entries, packer.block, "picture").tobytes() == b"\x00\xff"


def test_a_slow_motion_takes_little_space():
    """A smooth curve in steps of 0.1 mm: far less than four bytes a value."""
    time = np.linspace(0.0, 20.0, 500)[:, None]
    walk = np.sin(time + np.arange(300)[None] / 50.0)
    assert len(packed(walk=walk).block) < 1.5 * walk.size


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e9])
def test_what_cannot_be_stored_is_refused(value):
    with pytest.raises(ValueError, match="walk"):
        packed(walk=np.array([0.0, value]))


def test_damaged_arrays_are_refused():
    packer = packed(walk=np.arange(300.0))
    entry = packer.entries["walk"]
    wrong = [
        {},
        {"walk": entry | {"bytes": entry["bytes"] + 1}},
        {"walk": entry | {"at": -1}},
        {"walk": entry | {"shape": [299]}},
        {"walk": entry | {"shape": [10**9, 10**9]}},
        {"walk": entry | {"codec": "pickle"}},
        {"walk": entry | {"codec": "plain", "dtype": "object"}},
        {"walk": {"codec": "delta"}},
    ]
    for entries in wrong:
        with pytest.raises(PackingError):
            unpack(entries, packer.block, "walk")
    with pytest.raises(PackingError):
        unpack(packer.entries, packer.block[::-1], "walk")
