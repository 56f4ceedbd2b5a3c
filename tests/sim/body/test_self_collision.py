"""Self-collision: limbs collide with the trunk and with each other, not with themselves."""

import numpy as np
import pytest
from walking import empty_world, let_pass

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg, JointActionKind
from veca_marl.sim.body.humanoid.articulation import limb, may_collide
from veca_marl.sim.body.humanoid.postures import Posture, posture_angles

BONES = [bone.name for bone in load_skeleton().bones]


def test_every_bone_belongs_to_one_of_five_limbs():
    count = {name: sum(limb(bone) == name for bone in BONES) for name in map(limb, BONES)}
    assert count == {"trunk": 5, "l_arm": 18, "r_arm": 18, "l_leg": 3, "r_leg": 3}


@pytest.mark.parametrize(
    ("a", "b", "collide"),
    [
        ("l_hand", "head", True),
        ("l_hand", "r_index_distal", True),
        ("l_thigh", "r_thigh", True),
        ("l_forearm", "chest", True),
        ("l_upper_arm", "chest", False),
        ("pelvis", "r_thigh", False),
        ("l_hand", "l_thumb_distal", False),
        ("head", "chest", False),
    ],
)
def test_pairs_that_collide(a, b, collide):
    assert may_collide(a, b) is may_collide(b, a) is collide


@pytest.fixture
def floating():
    """Return a position-controlled body without gravity, far from the floor."""
    world = empty_world()
    body = Humanoid("child", HumanoidCfg(action=JointActionKind.position), world)
    world.client.setGravity(0.0, 0.0, 0.0)
    world.freeze()
    world.reset(np.random.default_rng(0))
    body.place((0.0, 0.0, 2.0))
    yield world, body
    world.close()


def contacts(world, body):
    found = world.client.getContactPoints(body.body_id, body.body_id)
    return [contact for contact in found if contact.distance_m < 0.0]


def go_to(world, body, **degrees):
    angles = posture_angles(body._skeleton, Posture(0.0, degrees))
    body.act(body.encode(angles))
    let_pass(world, 1.5)
    return angles


def test_a_standing_body_has_contacts_of_hands_and_thighs_only(floating):
    world, body = floating
    let_pass(world, 0.2)
    hands = [body.bone(f"{side}_hand").position for side in "lr"]
    for contact in contacts(world, body):
        assert min(np.linalg.norm(contact.position_on_a - hand) for hand in hands) < 0.06
        assert -contact.distance_m < 0.0035, "no deeper than the skin of the hand"


def test_the_legs_do_not_pass_through_each_other(floating):
    world, body = floating
    wanted = go_to(world, body, **{"thigh.abduction": -25.0})
    assert contacts(world, body)
    gap = body.bone("l_shank").position[1] - body.bone("r_shank").position[1]
    assert gap > 2 * 0.0185, "the left shank stays left of the right one"
    assert np.abs(body.joint_angles() - wanted).max() > np.radians(3.0)
