"""No bone is deeper in the floor, or in another body, than `DEEPEST_M`, whatever drives it."""

import numpy as np
import pytest
from humanoids import random_torques, remove_gravity, several_humanoids

from veca_marl.sim.body.anatomy import Underside, forward_kinematics
from veca_marl.sim.body.humanoid import Detail
from veca_marl.sim.body.humanoid.bone_ends import DEEPEST_M


class Depths:
    """The depth of the deepest bone of a body after each physics step, metres."""

    def __init__(self, world, body):
        self.body, self.seen = body, []
        self._bones = Underside(body._skeleton, body.bone_names, skin=False)
        self._positions, self._rotations = np.zeros((47, 3)), np.zeros((47, 3, 3))
        world.after_substep.append(self._note)

    def _note(self):
        articulation = self.body.articulation
        articulation.read()  # what Bullet has
        self._positions[0], self._rotations[0] = articulation.motion().pose
        angles = self.body.joint_angles()
        forward_kinematics(self.body._skeleton, angles, self._positions, self._rotations)
        self.seen.append(-self._bones.lowest_m(self._positions, self._rotations))


@pytest.mark.parametrize("detail", Detail)
def test_no_bone_is_deeper_in_the_floor_than_the_bound(detail):
    world, bodies = several_humanoids(2, detail)
    depths = [Depths(world, body) for body in bodies]
    for _ in random_torques(world, bodies, 4.0):
        pass
    world.close()
    seen = np.array([each.seen for each in depths])
    assert seen.max() <= DEEPEST_M + 1e-6
    assert seen.max() > 0.5 * DEEPEST_M, "bones were pressed into the floor"


def test_a_body_that_starts_in_the_floor_is_raised_in_one_step():
    world, (body,) = several_humanoids(1, Detail.mitten)
    body.place((0.0, 0.0, -0.5))
    depths = Depths(world, body)
    world.step()
    world.close()
    assert depths.seen[0] <= DEEPEST_M + 1e-6


def depth_in_each_other(world, bodies):
    first, second = (body.body_id for body in bodies)
    points = world.client.getClosestPoints(first, second, 0.0)
    return max((-point.distance_m for point in points), default=0.0)


@pytest.mark.parametrize("detail", Detail)
def test_two_bodies_are_no_deeper_in_each_other_than_the_bound(detail):
    world, bodies = several_humanoids(2, detail, walls=True)
    seen = []
    world.after_substep.append(lambda: seen.append(depth_in_each_other(world, bodies)))
    for _ in random_torques(world, bodies, 2.0):
        pass
    world.close()
    assert max(seen) <= DEEPEST_M + 1e-5
    assert max(seen) > 0.5 * DEEPEST_M, "the bodies were pressed into each other"


def test_bodies_of_different_mass_that_are_moved_apart_keep_their_centre_of_mass():
    world, bodies = several_humanoids(2, Detail.mitten)
    remove_gravity(world)
    for body, height_m in zip(bodies, (1.0, 1.1), strict=True):
        body.place((0.05 * height_m, 0.0, height_m))
    bodies[1].articulation.mass_kg *= 3.0  # what the shares are computed from

    def centre():
        found = [body.articulation.motion().pose.position for body in bodies]
        return (found[0] + 3.0 * found[1]) / 4.0

    world.client.performCollisionDetection()
    before, apart = centre(), [body.articulation.motion().pose.position for body in bodies]
    bodies[1].articulation.keep_apart([bodies[0].articulation])
    moved = [
        np.abs(body.articulation.motion().pose.position - old)[:2].max()
        for body, old in zip(bodies, apart, strict=True)
    ]
    assert min(moved) > 0.001
    assert moved[0] == pytest.approx(3.0 * moved[1])
    np.testing.assert_allclose(centre()[:2], before[:2], atol=1e-9)
    world.close()
