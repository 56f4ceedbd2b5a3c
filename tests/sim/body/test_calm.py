"""Bodies at rest: joint speeds of limp bodies and of bodies that hold a posture."""

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import JointActionKind
from veca_marl.sim.body.humanoid.postures import POSTURES
from veca_marl.sim.physics import pybullet

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


def test_a_full_body_holds_itself_on_all_fours():
    # three quarters of the weight are on the hands, which must not slide together for 4 s
    world = empty_world()
    cfg = HumanoidCfg(detail=Detail.full, action=JointActionKind.position)
    body = Humanoid("child", cfg, world)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES["on_all_fours"])
    targets = body.posture_angles(POSTURES["on_all_fours"])
    body.act(body.encode(targets))
    for _ in range(100):
        world.step()
    hand = body.bone_positions()[body.bone_names.index("l_hand")]
    errors = np.degrees(np.abs(body.joint_angles() - targets))
    world.close()
    assert body.position[2] > 0.17  # 0.172 m with the hands flat on the floor, 0.05 m after a fall
    assert hand[2] < 0.03
    assert errors.max() < 19.0


@pytest.mark.parametrize(
    ("detail", "action", "iterations"),
    [
        (Detail.full, JointActionKind.position, 20),
        (Detail.full, JointActionKind.torque, 10),
        (Detail.mitten, JointActionKind.position, 10),
    ],
)
def test_only_bodies_that_hold_angles_with_fingers_raise_the_iterations(detail, action, iterations):
    world = empty_world()
    Humanoid("child", HumanoidCfg(detail=detail, action=action), world)
    parameters = pybullet.getPhysicsEngineParameters(physicsClientId=world.client)
    world.close()
    assert parameters["numSolverIterations"] == iterations
