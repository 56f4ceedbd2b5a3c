"""Touch of bodies from 1 to 36 months: exactly zero without contact, and no part of it is numb."""

import numpy as np
import pytest
from skins import SHIRT, random_turn
from stand_in_worlds import SceneWorld
from touching import SPREAD, Named

from veca_marl.sim.body.anatomy import forward_kinematics, growth_at, load_skeleton
from veca_marl.sim.body.appearance import bone_geoms, dressed_skin
from veca_marl.sim.body.humanoid.postures import (
    OFFERING,
    ON_BACK,
    ON_BELLY,
    REACHING,
    posture_angles,
)
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.touch import TouchCfg, TouchSense, taxel_positions
from veca_marl.sim.touch.taxels import load_taxels
from veca_marl.sim.touch.touch_sense import own_overlaps

FIELD = TouchCfg().receptive_field
# arms off the trunk and the thighs, hands open
POSES = [
    SPREAD,
    *(posture_angles(load_skeleton(), each) for each in (ON_BACK, ON_BELLY, OFFERING, REACHING)),
]


class Grown:
    """A body of an age alone in a scene."""

    def __init__(self, months, share=FIELD):
        self.growth = growth_at(float(months))
        self.skeleton, self.scene = load_skeleton(self.growth), Scene()
        self.body = self.scene.add_object(
            "body", bone_geoms(self.skeleton, SHIRT), dressed_skin(self.skeleton, SHIRT)
        )
        self.sense = TouchSense(
            TouchCfg(receptive_field=share),
            Named("body", self.body.id, self.growth),
            SceneWorld(self.scene),
        )
        self.pose(SPREAD, np.zeros(3), np.eye(3))

    def pose(self, angles, position, rotation):
        self.body.positions[0], self.body.rotations[0] = position, rotation
        forward_kinematics(self.skeleton, angles, self.body.positions, self.body.rotations)

    def read(self):
        self.scene.update()
        return self.sense.update_taxels().copy()


@pytest.mark.parametrize("share", [0.0, FIELD])
@pytest.mark.parametrize("months", [*range(1, 13), 18, 24, 36])
def test_without_contact_the_whole_skin_reads_exactly_zero_at_every_age(months, share):
    body, rng = Grown(months, share), np.random.default_rng(months)
    for angles in POSES:
        body.pose(angles, rng.normal(size=3), random_turn(rng))
        assert not body.read().any()


@pytest.mark.parametrize("months", [1, 3, 6])
def test_taxels_at_the_base_of_the_thumb_feel_all_but_that_bone(months):
    """Another thing, and another part of the own body in place of the thumb."""
    body = Grown(months)
    overlaps = own_overlaps(FIELD, body.growth)
    bones, triangles = np.nonzero(overlaps.joined)
    assert {body.skeleton.bones[bone].name[2:] for bone in bones} == {"thumb_proximal"}
    assert (overlaps.joined.sum(axis=0) <= 1).all()
    ball = body.scene.add_object("ball", [[Geom(Shape.SPHERE, (0.004,))]])
    for triangle in triangles:
        places, normals = places_of(body)
        ball.positions[0] = places[triangle].mean(axis=0) + 0.0035 * normals[triangle]
        assert body.read()[triangle].any()
        ball.positions[0] = (0.0, 0.0, 5.0)
        side = body.skeleton.bones[bone_of(body, triangle)].name[0]
        other = body.skeleton.bone(f"{side}_index_distal")
        body.body.positions[other] = places[triangle].mean(axis=0) - body.body.rotations[other] @ (
            body.skeleton.bones[other].colliders[0].pose.position
        )
        assert body.read()[triangle].any()
        body.pose(SPREAD, np.zeros(3), np.eye(3))


def places_of(body):
    """Positions of the taxels, and normals of their triangles."""
    body.scene.update()
    vertices = body.scene.meshes.vertices[body.body.vertices]
    return taxel_positions(load_taxels(body.growth), vertices)


def bone_of(body, triangle):
    """The bone of a triangle."""
    first = load_taxels(body.growth).first_triangle
    return int(np.searchsorted(first, triangle, "right")) - 1
