"""Rebounds add no energy, whatever the time step."""

import numpy as np
import pytest
from walking import ball, box, empty_world, walker_in

from veca_marl.sim.geometry import quaternions_to_matrices
from veca_marl.sim.physics import GRAVITY_MPS2, ClockCfg

CLOCKS = [ClockCfg(substeps=substeps) for substeps in (5, 10, 40)]


def begun(*props, clock):
    world = empty_world(*props, clock=clock)
    world.freeze()
    world.reset(np.random.default_rng(0))
    return world


def energy_j(world, weight=True):
    """Kinetic and, with weight, potential energy of all props."""
    total = 0.0
    for prop in world.props.values():
        info = world.client.getDynamicsInfo(prop.body_id, -1)
        place, orientation = world.client.getBasePositionAndOrientation(prop.body_id)
        velocity, spin = (np.array(v) for v in world.client.getBaseVelocity(prop.body_id))
        rotation = np.empty((1, 3, 3))
        quaternions_to_matrices(np.array([orientation]), rotation)
        turning = rotation[0].T @ spin
        total += 0.5 * info.mass_kg * float(velocity @ velocity)
        total += 0.5 * float(turning @ (np.array(info.moments) * turning))
        total += weight * info.mass_kg * GRAVITY_MPS2 * place[2]
    return total


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("radius_m", [0.01, 0.1])
@pytest.mark.parametrize("height_m", [0.05, 0.33, 1.0])
def test_a_ball_of_restitution_1_never_rises_higher_than_it_fell(height_m, radius_m, clock):
    """Within the way of one physics step; at least as fast as four fifths it does rebound."""
    drop = ball("ball", radius_m, 0.2, (0.0, 0.0, height_m + radius_m), restitution=1.0)
    world = begun(drop, clock=clock)
    heights, speeds = [], []

    def record():
        place, _ = world.client.getBasePositionAndOrientation(world.prop("ball").body_id)
        heights.append(place[2] - radius_m)
        speeds.append(world.prop("ball").velocity[2])

    world.after_substep.append(record)
    for _ in range(60):
        world.step()
    fastest_mps = np.sqrt(2.0 * GRAVITY_MPS2 * height_m)
    landed = int(np.argmax(np.array(speeds) > 0.0))
    assert max(heights) < height_m + 0.5 * fastest_mps * clock.substep_s
    assert speeds[landed] > 0.6 * fastest_mps
    assert max(speeds) <= fastest_mps * (1.0 + 1e-6) + GRAVITY_MPS2 * clock.substep_s
    world.close()


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("block_kg", [0.2, 0.0])
def test_a_collision_off_centre_adds_no_energy_and_keeps_the_momentum(block_kg, clock):
    """Two props in free flight, and a prop and a fixed thing."""
    block = box("block", (0.1, 0.2, 0.1), block_kg, (0.3, 0.03, 1.0), restitution=1.0, friction=0.0)
    cube = box("cube", (0.1,) * 3, 0.1, (0.0, 0.0, 1.0), restitution=1.0, friction=0.0)
    world = begun(cube, block, clock=clock)
    world.client.setGravity(0.0, 0.0, 0.0)
    world.client.changeDynamics(world.prop("block").body_id, -1, restitution=1.0)
    world.prop("cube").set_velocity((2.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    before_j = energy_j(world, weight=False)
    for _ in range(12):
        world.step()
    assert world.prop("cube").velocity[0] < 1.5, "it has hit the block"
    assert energy_j(world, weight=False) <= before_j * (1.0 + 1e-6)
    if block_kg:
        momentum = 0.1 * world.prop("cube").velocity + block_kg * world.prop("block").velocity
        np.testing.assert_allclose(momentum, (0.2, 0.0, 0.0), atol=1e-9)
    world.close()


@pytest.mark.parametrize(("of_body", "expected"), [(0.0, 0.0), (1.0, 0.5)])
def test_a_ball_rebounds_from_a_walker_as_their_restitutions_say(of_body, expected):
    rolling = ball("ball", 0.1, 0.3, (0.6, 0.0, 0.5), restitution=0.5, friction=0.0)
    world = empty_world(rolling)
    walker = walker_in(world, restitution=of_body)
    world.freeze()
    world.reset(np.random.default_rng(0))
    walker.place((0.0, 0.0, 0.0))
    world.client.setGravity(0.0, 0.0, 0.0)
    world.prop("ball").set_velocity((-2.0, 0.0, 0.0))
    for _ in range(12):
        world.step()
    assert world.prop("ball").velocity[0] == pytest.approx(2.0 * expected, abs=0.25)
    world.close()
