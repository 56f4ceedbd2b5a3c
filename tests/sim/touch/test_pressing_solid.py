"""Skins that press on another skin: what each side reads follows from the gap between the bones."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skins import add_body, pose, random_turn
from touching import SPREAD, Stage, of_bone

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import distances_to

CORE_M, SKIN_M = 0.03, 0.004
FOREARM_MIDDLE = np.array([0.0, 0.0, -0.0475])
# what points at the forearm: its distance from the middle of the core, and the turn that does it
EDGE = Rotation.from_euler("z", 45, degrees=True)
CORNER = Rotation.align_vectors([[1.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]])[0]
RIM = Rotation.from_euler("y", 45, degrees=True)
BOX = ("BOX", (CORE_M + SKIN_M,) * 3)
CYLINDER = ("CYLINDER", (CORE_M + SKIN_M, 2.0 * (CORE_M + SKIN_M)))
POINTED = {
    "face": (*BOX, CORE_M, Rotation.identity()),
    "edge": (*BOX, CORE_M * 2.0**0.5, EDGE),
    "corner": (*BOX, CORE_M * 3.0**0.5, CORNER),
    "rim": (*CYLINDER, CORE_M * 2.0**0.5, RIM),
}


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("what", POINTED)
def test_an_edge_with_a_skin_reads_the_share_by_which_both_skins_are_compressed(what, share):
    """The edge of the skin is round: it is as thick there as on a face."""
    shape, size, away, turn = POINTED[what]
    stage = Stage()
    bone = load_skeleton().bones[stage.bone("l_forearm")]
    gap = (1.0 - share) * (bone.skin_thickness_m + SKIN_M)
    there = np.array([bone.colliders[0].radius + gap + away, 0.0, 0.0])
    frame = stage.body.rotations[stage.bone("l_forearm")]
    stage.add(
        shape, size, stage.at("l_forearm", FOREARM_MIDDLE + there), frame @ turn.as_matrix(), SKIN_M
    )
    largest = of_bone(stage.read(), "l_forearm").max()
    assert largest <= share + 1e-6
    assert largest > share - 0.15  # the nearest taxel is not exactly below the edge


@pytest.mark.slow
def test_no_skin_reads_more_than_the_share_by_which_the_bones_compress_both():
    """A foot, which has a box, at random poses beside a forearm, which is a capsule."""
    rng, found = np.random.default_rng(0), 0
    while found < 20:
        stage = Stage()
        other = add_body(stage.scene, "other")
        turn = random_turn(rng)
        pose(other, SPREAD, rotation=turn)
        here = stage.at("l_forearm", FOREARM_MIDDLE + 0.06 * unit(rng))
        pose(other, SPREAD, here - other.positions[stage.bone("r_foot")], turn)
        share = compressed_share(stage.body, other)
        if 0.2 < share < 0.9:
            found += 1
            assert of_bone(stage.read(), "l_forearm").max() <= share + 0.01  # gaps are sampled


def unit(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def compressed_share(body, other):
    """Largest share by which any bone of a body compresses its skin and that of a left forearm."""
    bones, arm = load_skeleton().bones, load_skeleton().bone("l_forearm")
    (capsule,) = bones[arm].colliders
    half = np.linspace(-0.5, 0.5, 400)[:, None] * capsule.length * np.array([0.0, 0.0, 1.0])
    centre, rotation = capsule.pose
    axis = body.positions[arm] + (centre + half @ rotation.T) @ body.rotations[arm].T
    shares = []
    for index, bone in enumerate(bones):
        local = (axis - other.positions[index]) @ other.rotations[index]
        gap = min(distances_to(part, local).min() for part in bone.colliders) - capsule.radius
        shares.append(1.0 - gap / (bone.skin_thickness_m + bones[arm].skin_thickness_m))
    return max(shares)
