"""Fixtures of several tests of the simulator."""

import numpy as np
import pytest
from walking import empty_world

from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg


@pytest.fixture
def make_child():
    """Make a world with things and a joint-level body in it."""
    worlds = []

    def humanoid(*props, **cfg):
        world = empty_world(*props)
        worlds.append(world)
        body = Humanoid("child", HumanoidCfg(**cfg), world)
        world.freeze()
        world.reset(np.random.default_rng(0))
        return world, body

    yield humanoid
    for world in worlds:
        world.close()
