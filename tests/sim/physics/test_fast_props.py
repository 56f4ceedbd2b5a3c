"""Small, fast props do not pass through thin things, whatever the phase of the physics step."""

import math

import numpy as np
import pytest
from walking import ball, box, empty_world, walker_in

from veca_marl.sim.physics import ClockCfg

FACE_M = 1.0
PHASES = 8


def plate(thickness_m, mass_kg=0.0):
    """Return a plate across the x axis whose near face is at a metre."""
    middle = FACE_M + thickness_m / 2.0
    return box("plate", (thickness_m, 2.0, 2.0), mass_kg, (middle, 0.0, 1.0))


def bullet(shape, half_m, restitution=0.3):
    if shape == "ball":
        return ball("bullet", half_m, 0.1, (0.0, 0.0, 1.0), restitution=restitution)
    return box("bullet", [2.0 * half_m] * 3, 0.1, (0.0, 0.0, 1.0), restitution=restitution)


def shots(world, speed):
    """Shoot at the plate in all phases of a physics step; yield after each."""
    thing, step_m = world.prop("bullet"), speed * world.clock.substep_s
    world.freeze()
    for phase in range(PHASES):
        world.reset(np.random.default_rng(0))
        world.client.setGravity(0.0, 0.0, 0.0)
        thing.place((0.6 + phase / PHASES * step_m, 0.0, 1.0), velocity=(speed, 0.0, 0.0))
        world.refresh()
        for _ in range(math.ceil(0.8 / speed / world.clock.step_s)):
            world.step()
        yield thing


@pytest.mark.parametrize("shape", ["ball", "box"])
@pytest.mark.parametrize("thickness_m", [0.002, 0.01, 0.05])
@pytest.mark.parametrize(
    ("half_m", "speed"), [(0.005, 2.0), (0.01, 3.0), (0.02, 5.0), (0.02, 20.0)]
)
def test_nothing_passes_through_a_plate(shape, half_m, speed, thickness_m):
    world = empty_world(plate(thickness_m), bullet(shape, half_m))
    for thing in shots(world, speed):
        assert thing.position[0] < FACE_M
        assert thing.velocity[0] < 0.01


@pytest.mark.parametrize("substeps", [2, 5, 10])
def test_nothing_passes_through_a_plate_at_other_clocks(substeps):
    world = empty_world(plate(0.01), bullet("ball", 0.01), clock=ClockCfg(substeps=substeps))
    for thing in shots(world, 4.0):
        assert thing.position[0] < FACE_M


def test_a_fast_ball_rebounds_with_the_speed_of_its_restitution():
    """The floor's restitution of 1 is given to the plate as well."""
    world = empty_world(plate(0.01), bullet("ball", 0.01, restitution=0.5))
    world.client.changeDynamics(world.prop("plate").body_id, -1, restitution=1.0)
    for thing in shots(world, 6.0):
        assert thing.velocity[0] == pytest.approx(-3.0, abs=0.6)
        assert np.abs(thing.velocity[1:]).max() < 0.01


def test_momentum_is_conserved_where_a_fast_ball_hits_something_movable():
    target = box("plate", (0.02, 0.2, 0.2), 0.2, (FACE_M + 0.01, 0.0, 1.0))
    world = empty_world(target, bullet("ball", 0.01))
    for thing in shots(world, 6.0):
        total = 0.1 * thing.velocity + 0.2 * world.prop("plate").velocity
        np.testing.assert_allclose(total, (0.6, 0.0, 0.0), atol=1e-6)
        assert world.prop("plate").velocity[0] > 1.5


def test_a_fast_ball_that_meets_nothing_flies_as_if_it_were_slow():
    world = empty_world(plate(0.01), bullet("ball", 0.01))
    thing = world.prop("bullet")
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.client.setGravity(0.0, 0.0, 0.0)
    thing.place((0.0, 0.0, 1.0), velocity=(0.0, 8.0, 0.0))
    for _ in range(10):
        world.step()
    np.testing.assert_allclose(thing.position, (0.0, 3.2, 1.0), atol=1e-9)


def test_a_kicked_marble_does_not_pass_through_a_plate():
    world = empty_world(
        box("plate", (0.01, 2.0, 0.5), 0.0, (0.5, 0.0, 0.25)),
        ball("marble", 0.01, 0.02, (0.2, 0.0, 0.01)),
    )
    walker = walker_in(world)
    world.freeze()
    for x in np.linspace(0.17, 0.24, PHASES):
        world.reset(np.random.default_rng(0))
        walker.place((0.0, 0.0, 0.0))
        marble = world.prop("marble")
        marble.place((x, 0.0, 0.01))
        world.refresh()
        assert walker.kick(marble)
        for _ in range(15):
            world.step()
            assert marble.position[0] < 0.5
