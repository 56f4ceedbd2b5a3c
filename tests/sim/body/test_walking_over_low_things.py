"""Low things and flat slopes do not stop a walk; higher and steeper ones do."""

import math

import numpy as np
import pytest
from walking import box, empty_world, walker_in

from veca_marl.sim.physics import PropCfg, PropShape


def walked(prop, yaw_deg=0.0, steps=60, **numbers):
    """Return positions of the pelvis while it walks forward at 0.8 m/s, and the walker."""
    world = empty_world(prop)
    walker = walker_in(world, yaw_deg=yaw_deg, **numbers)
    world.freeze()
    world.reset(np.random.default_rng(0))
    walker.place((0.0, 0.0, 0.0), math.radians(yaw_deg))
    walker.walk(0.8, 0.0)
    seen = []
    for _ in range(steps):
        world.step()
        seen.append(walker.position.copy())
    world.close()
    return np.array(seen)


def slab(height_m, mass_kg=0.0):
    return box("slab", (0.6, 2.0, height_m), mass_kg, (0.8, 0.0, height_m / 2.0))


def ramp(slope_deg, length_m=0.8):
    rise_m = length_m * math.tan(math.radians(slope_deg))
    points = [
        [x, y, z] for y in (-1.0, 1.0) for x, z in ((0.0, 0.0), (length_m, 0.0), (length_m, rise_m))
    ]
    return PropCfg("ramp", PropShape.convex, [], (0.4, 0.0, 0.0), points_m=points)


@pytest.mark.parametrize("mass_kg", [0.0, 50.0])
@pytest.mark.parametrize("yaw_deg", [0.0, 25.0])
@pytest.mark.parametrize("height_m", [0.02, 0.05])
def test_a_walker_walks_over_a_low_thing(height_m, yaw_deg, mass_kg):
    way = walked(slab(height_m, mass_kg), yaw_deg)
    assert way[-1, 0] > 1.5
    on_it = np.abs(way[:, 0] - 0.8) < 0.25
    rise_m = way[on_it, 2].mean() - way[:5, 2].mean()
    assert rise_m == pytest.approx(height_m, abs=0.015)
    assert way[-1, 2] == pytest.approx(way[3, 2], abs=0.02)


def test_a_higher_thing_stops_it_and_so_does_a_low_one_without_a_stride():
    assert walked(slab(0.08))[-1, 0] < 0.42
    assert walked(slab(0.02), stride_height_m=0.0)[-1, 0] < 0.42


def test_it_walks_up_a_flat_slope_and_not_up_a_steep_one():
    up = walked(ramp(15.0), steps=35)
    assert up[-1, 0] > 0.9
    assert up[:, 2].max() - up[0, 2] > 0.12
    assert walked(ramp(35.0), steps=35)[-1, 0] < 0.6
