"""Blocks that lie on each other are at rest with the clock of the tasks with blocks."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.tasks.objects.toys_and_blocks import RED, BlocksCfg, add_block, rests_on
from veca_marl.sim.physics import World

EDGE = 0.06


@pytest.fixture(scope="module")
def blocks():
    """A world without a body, with three blocks."""
    game = compose(["+task=PileUpBlock"]).game
    world, cfg = World(game.playground, game.clock), BlocksCfg()
    blocks = [add_block(world, cfg, name, RED) for name in ("base", "block", "third")]
    world.freeze()
    yield world, *blocks
    world.close()


def let_settle(world, block, place, yaw_rad=0.0):
    block.place((1.0 + place[0] * EDGE, 1.0 + place[1] * EDGE, 1.5 * EDGE + 0.001), yaw_rad)
    for _ in range(25):
        world.step()


@pytest.mark.parametrize(
    ("place", "yaw_deg"),
    [((0.0, 0.0), 0.0), ((0.4, 0.0), 10.0), ((0.3, 0.3), 0.0), ((0.3, 0.3), 45.0)],
)
def test_a_block_on_another_one_stays_at_rest(blocks, place, yaw_deg):
    world, base, block, _ = blocks
    world.reset(np.random.default_rng(0))
    base.place((1.0, 1.0, EDGE / 2))
    let_settle(world, block, place, math.radians(yaw_deg))
    before = block.position
    for _ in range(100):
        world.step()
        assert rests_on(block, base)
    assert np.linalg.norm(block.position - before) < 0.002


@pytest.mark.parametrize("gap", [1.05, 1.8])
def test_a_block_on_two_others_rests_on_one_of_them(blocks, gap):
    world, base, block, third = blocks
    world.reset(np.random.default_rng(0))
    base.place((1.0, 1.0, EDGE / 2))
    third.place((1.0 + gap * EDGE, 1.0, EDGE / 2))
    let_settle(world, block, (gap / 2, 0.0))
    for _ in range(50):
        world.step()
        assert rests_on(block, base) or rests_on(block, third)
    assert not rests_on(third, base)


def test_both_tasks_have_the_same_clock():
    clocks = [compose([f"+task={task}"]).game.clock for task in ("PileUpBlock", "PutDownBlock")]
    assert clocks[0] == clocks[1]
