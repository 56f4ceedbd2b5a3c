"""No bone is deeper in the floor than `DEEPEST_M`, whatever drives the joints."""

import numpy as np
import pytest
from humanoids import random_torques, several_humanoids

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
