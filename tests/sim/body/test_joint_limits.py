"""Joint limits hold exactly at every physics step, and holding them adds no energy."""

import numpy as np
import pytest
from humanoids import (
    kinetic_energy,
    random_torques,
    remove_gravity,
    set_random_joint_speeds,
    several_humanoids,
)
from refusals import naming
from walking import empty_world

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.humanoid import HOLDING_MARGIN_RAD
from veca_marl.sim.body.humanoid.joint_control import JointActionKind
from veca_marl.sim.physics import ClockCfg

LOW = np.array([joint.low_rad for joint in load_skeleton().joints])
HIGH = np.array([joint.high_rad for joint in load_skeleton().joints])


@pytest.fixture(params=Detail)
def alone(request):
    world, (body,) = several_humanoids(1, request.param)
    yield world, body
    world.close()


def watch_limits(world, body):
    """Return a list to which Bullet's angles are added after every physics step."""
    seen = []

    def note():
        body.articulation.read()
        seen.append(body.joint_angles())

    world.after_substep.append(note)
    return seen


def test_no_joint_is_beyond_its_limit_after_any_physics_step(alone):
    world, body = alone
    seen = watch_limits(world, body)
    for _ in random_torques(world, [body], 2.0):
        pass
    seen = np.array(seen)
    assert len(seen) == 2 * 25 * 5
    assert (seen >= LOW).all()
    assert (seen <= HIGH).all()
    gaps = np.minimum(seen - LOW, HIGH - seen).min(0)
    assert (gaps < 2e-4).sum() > 30, "many limits were reached"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_joints_driven_against_their_limits_stay_there(alone, sign):
    world, body = alone
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0))
    body.act({"joints": np.full(82, sign)})
    for _ in range(50):
        world.step()
    moving = body.articulation.moving
    distance = np.abs(body.joint_angles() - (HIGH if sign > 0 else LOW))[moving]
    # legs and arms that collide keep some joints from their limits
    assert np.mean(distance < np.radians(1.0)) > 0.7
    assert (body.joint_angles() <= HIGH).all()
    assert (body.joint_angles() >= LOW).all()


@pytest.mark.parametrize("speed_radps", [5.0, 15.0])
def test_reaching_the_limits_adds_no_energy_without_gravity(alone, speed_radps):
    world, body = alone
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0))
    set_random_joint_speeds(world, body, speed_radps)
    energies, reached = [kinetic_energy(world, body)], 0
    for _ in range(25):
        world.step()
        energies.append(kinetic_energy(world, body))
        gaps = np.minimum(body.joint_angles() - LOW, HIGH - body.joint_angles())
        reached += int((gaps <= 2e-4).sum())
    assert reached > 0
    assert (np.diff(energies) <= 0.0).all()


@pytest.fixture
def held():
    world = empty_world()
    cfg = HumanoidCfg(detail=Detail.mitten, action=JointActionKind.position)
    body = Humanoid("child", cfg, world)
    remove_gravity(world)
    body.place((0.0, 0.0, 2.0), 0.0, np.zeros(82))
    yield world, body
    world.close()


def test_joints_without_fingers_that_hold_angles_start_at_limits_and_return_slowly(held):
    world, body = held
    knees = [body.joint_names.index(f"{side}_shank.flexion") for side in "lr"]
    fastest = []
    world.after_substep.append(lambda: fastest.append(np.abs(body.joint_velocities()).max()))
    body.act(body.encode(np.zeros(82)))
    world.step()
    assert (body.joint_angles()[knees] > LOW[knees] + HOLDING_MARGIN_RAD - 1e-4).all()
    assert max(fastest) < 1.1  # 2.5 rad/s if they returned in one physics step


def test_joints_that_hold_angles_beyond_their_margin_stay_within_their_limits(held):
    world, body = held
    seen, rng = watch_limits(world, body), np.random.default_rng(0)
    for _ in range(25):
        body.act({"joints": rng.choice([-1.0, 1.0], 82)})
        world.step()
    seen = np.array(seen)
    assert (seen >= LOW).all()
    assert (seen <= HIGH).all()
    moving = body.articulation.moving
    gaps = np.minimum(seen - LOW, HIGH - seen)[:, moving].min(0)
    assert (gaps < HOLDING_MARGIN_RAD + 1e-3).sum() > 15


@pytest.mark.parametrize("step_s", [0.008, 0.020])
def test_damping_takes_energy_at_any_step(alone, step_s):
    """Explicit damping is unstable here: its greatest ``dt eig(M^-1 D)`` is far above 2."""
    world, body = alone
    remove_gravity(world)
    rng = np.random.default_rng(0)
    dynamics = body.articulation.dynamics
    for _ in range(20):
        body.place((0.0, 0.0, 1.0), 0.0, rng.uniform(0.9 * LOW, 0.9 * HIGH))
        dynamics.state.velocity[6:] = rng.normal(0.0, 0.1, len(dynamics.state.velocity) - 6)
        before = dynamics.kinetic_energy()
        dynamics.torques(step_s)
        dynamics.state.velocity[:] += step_s * dynamics.forces.accelerations
        assert 0.0 < dynamics.kinetic_energy() < before


def test_too_long_physics_steps_are_refused():
    world = empty_world(clock=ClockCfg(substeps=3))
    with pytest.raises(ValueError, match=naming("child", "13.3 ms", "clock.substeps")):
        Humanoid("child", HumanoidCfg(), world)
    world.close()
