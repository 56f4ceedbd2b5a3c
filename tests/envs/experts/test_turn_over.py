"""Turning over the left or the right side."""

from veca_marl.envs.experts.control.posture_transitions import mirrored
from veca_marl.sim.body.humanoid.postures import Posture


def test_a_mirrored_posture_swaps_the_sides_and_turns_the_trunk_the_other_way():
    joints = {"l_thigh.flexion": 85.0, "spine.rotation": 10.0, "chest.lateral": -20.0}
    both = {"upper_arm.flexion": 160.0, "neck.flexion": 45.0}
    opposite = {"r_thigh.flexion": 85.0, "spine.rotation": -10.0, "chest.lateral": 20.0}
    assert mirrored(Posture(3.0, {**joints, **both})) == Posture(3.0, {**opposite, **both})
