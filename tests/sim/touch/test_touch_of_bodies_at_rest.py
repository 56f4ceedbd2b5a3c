"""Touch of whole bodies at rest, over physics steps of 8 to 1 ms.

Two things can make it depend on the step: the reading of a pose, and the pose at rest. The reading
does not. Without friction the pose does not either. With friction there is a continuum of poses at
rest, because friction holds a body in any of them; which one it ends in depends on how it settles.
"""

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import JointActionKind
from veca_marl.sim.body.humanoid.postures import ON_BACK, ON_BELLY, SITTING
from veca_marl.sim.physics import ClockCfg
from veca_marl.sim.touch import TouchCfg, TouchSense

SUBSTEPS = (5, 10, 20, 40)  # of 40 ms


def resting_body(substeps, friction):
    world = empty_world(clock=ClockCfg(substeps=substeps))
    cfg = HumanoidCfg(action=JointActionKind.position, friction=friction)
    body = Humanoid("child", cfg, world)
    sense = TouchSense(TouchCfg(), body, world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    return world, body, sense


def settled(substeps, posture, friction):
    """Return readings and pose of a body that has held a posture on the floor for 1.6 s."""
    world, body, sense = resting_body(substeps, friction)
    body.place((0.0, 0.0, 0.0), 0.0, posture)
    world.refresh()
    body.rest()
    for _ in range(40):
        world.step()
    readings, pose = sense.update_taxels().copy(), body.articulation.motion().pose
    angles = body.joint_angles().copy()
    world.close()
    return readings, pose, angles


def carried_on(substeps, posture, friction, pose, angles):
    """Return the readings 1 s after a body that holds a posture has been put into a pose."""
    world, body, sense = resting_body(substeps, friction)
    body.place((0.0, 0.0, 0.0), 0.0, posture)
    body.rest()
    body.articulation.place(pose, angles)
    body.articulation.read()
    world.refresh()
    for _ in range(25):
        world.step()
    readings = sense.update_taxels().copy()
    world.close()
    return readings


def sums(posture, friction):
    return np.array([settled(substeps, posture, friction)[0].sum() for substeps in SUBSTEPS])


@pytest.mark.slow
@pytest.mark.parametrize("posture", [ON_BACK, SITTING])
def test_a_pose_has_the_same_reading_at_every_time_step(posture):
    expected, pose, angles = settled(SUBSTEPS[0], posture, friction=0.8)
    assert expected.max() > 0.5
    for substeps in SUBSTEPS:
        world, body, sense = resting_body(substeps, friction=0.8)
        body.articulation.place(pose, angles)
        body.articulation.read()
        world.refresh()
        np.testing.assert_allclose(sense.update_taxels(), expected, atol=1e-6)
        world.close()


@pytest.mark.slow
@pytest.mark.parametrize("posture", [ON_BACK, ON_BELLY])
def test_without_friction_a_lying_body_has_one_pose_at_rest_at_every_time_step(posture):
    found = sums(posture, friction=0.0)
    assert found.min() > 10.0
    assert found.max() / found.min() < 1.03


@pytest.mark.slow
@pytest.mark.parametrize("settled_at", [5, 10])
def test_a_lying_body_at_rest_at_one_time_step_is_at_rest_at_all(settled_at):
    """With friction, too; the sums of T of the two poses themselves differ by 0.11."""
    readings, pose, angles = settled(settled_at, ON_BACK, friction=0.8)
    for substeps in SUBSTEPS:
        later = carried_on(substeps, ON_BACK, 0.8, pose, angles)
        assert later.sum() == pytest.approx(readings.sum(), rel=0.03)


@pytest.mark.slow
def test_friction_makes_the_pose_at_rest_of_a_lying_body_depend_on_how_it_settles():
    """A bound; at 8 ms chest and neck come to rest a little higher than at shorter steps."""
    found = sums(ON_BACK, friction=0.8)
    assert found.max() / found.min() < 1.25
