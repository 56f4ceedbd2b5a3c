"""Bodies at rest: joint speeds of limp bodies and of bodies that hold a posture."""

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import JointActionKind
from veca_marl.sim.body.humanoid.postures import POSTURES

SETTLING_S, MEASURED_S = 3.0, 1.0
LIMP_S = 6.0  # a head that stands on its forehead falls to a side after up to 4 s


def fastest_joint_radps(detail, action, posture, settling_s=SETTLING_S):
    """Return the largest root mean square of a joint's speed after a body has settled."""
    world = empty_world()
    body = Humanoid("child", HumanoidCfg(detail=detail, action=action), world)
    body.place((0.0, 0.0, 0.0), 0.0, POSTURES[posture])
    if action is JointActionKind.position:
        body.act(body.encode(body.posture_angles(POSTURES[posture])))
    speeds = []
    for step in range(round((settling_s + MEASURED_S) * 25)):
        world.step()
        if step >= round(settling_s * 25):
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
    assert fastest_joint_radps(Detail.mitten, JointActionKind.torque, posture, LIMP_S) < 0.2


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


def mitten_on_all_fours(world, seed):
    """Return a `mitten` that holds the angles of its start; those of seed 0 are not perturbed."""
    body = Humanoid(
        "child", HumanoidCfg(detail=Detail.mitten, action=JointActionKind.position), world
    )
    rng, posture, yaw = np.random.default_rng(seed), POSTURES["on_all_fours"], 0.0
    if seed:
        posture, yaw = body.perturb(posture, 2.0, rng), float(rng.uniform(-3.0, 3.0))
    body.place((0.0, 0.0, 0.0), yaw, posture)
    body.act(body.encode(body.posture_angles(posture)))
    return body


def test_the_hands_of_a_mitten_on_all_fours_do_not_slide_together():
    # clipping the angle of a wrist at its limit in each physics step moves the palm inward
    world = empty_world()
    body = mitten_on_all_fours(world, 0)
    hands = [body.bone_names.index(name) for name in ("l_hand", "r_hand")]
    distances_m = []
    for _ in range(50):
        world.step()
        distances_m.append(np.linalg.norm(np.diff(body.bone_positions()[hands], axis=0)))
    world.close()
    assert abs(distances_m[49] - distances_m[24]) < 0.005  # between 1 s and 2 s


@pytest.mark.slow
def test_a_mitten_stays_on_all_fours_for_8_s_from_nine_of_ten_starts():
    standing = 0
    for seed in range(10):
        world = empty_world()
        body = mitten_on_all_fours(world, seed)
        lowest_m = 0.7 * body.position[2]
        for _ in range(200):
            world.step()
            if body.position[2] < lowest_m:
                break
        else:
            standing += 1
        world.close()
    assert standing >= 9


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
    parameters = world.client.getPhysicsEngineParameters()
    world.close()
    assert parameters["numSolverIterations"] == iterations
