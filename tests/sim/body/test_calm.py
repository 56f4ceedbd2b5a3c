"""Bodies at rest: joint speeds of limp bodies and of bodies that hold a posture."""

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import JointActionKind
from veca_marl.sim.body.humanoid.postures import POSTURES

SETTLING_S, MEASURED_S = 3.0, 1.0


def fastest_joint_radps(detail, action, posture):
    """Return the largest root mean square of a joint's speed after a body has settled."""
    world = empty_world()
    body = Humanoid("child", HumanoidCfg(detail=detail, action=action), world)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES[posture])
    if action is JointActionKind.position:
        body.act(body.encode(body.posture_angles(POSTURES[posture])))
    speeds = []
    for step in range(round((SETTLING_S + MEASURED_S) * 25)):
        world.step()
        if step >= round(SETTLING_S * 25):
            speeds.append(body.joint_velocities())
    world.close()
    return float(np.sqrt(np.square(speeds).mean(0)).max())


@pytest.mark.parametrize(
    ("detail", "posture", "bound"),
    [
        (Detail.mitten, "on_back", 0.01),
        (Detail.mitten, "sitting", 0.01),
        (Detail.mitten, "reaching", 0.05),
        (Detail.full, "on_back", 0.02),
    ],
)
def test_a_posture_that_is_held_is_at_rest(detail, posture, bound):
    assert fastest_joint_radps(detail, JointActionKind.position, posture) < bound


@pytest.mark.parametrize("posture", ["on_back", "on_belly"])
def test_a_limp_body_on_the_floor_comes_to_rest(posture):
    assert fastest_joint_radps(Detail.mitten, JointActionKind.torque, posture) < 0.2
