"""A large empty world for experiments with a few props."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from veca_marl.sim.physics import ClockCfg, PlaygroundCfg, PropCfg, RoomCfg, World

SUBSTEPS = (5, 10, 20, 40)
"""Physics steps per agent step of 40 ms, for steps of 8, 4, 2 and 1 ms."""
_SIZE_M = 100.0
_HEIGHT_M = 50.0


def make_arena(substeps: int, *props: PropCfg) -> World:
    """Return a frozen world with a floor, without walls and echoes.

    Args:
        substeps: Physics steps per agent step of 40 ms.
        props: What is in it.
    """
    half = _SIZE_M / 2
    room = RoomCfg(lower_m=(-half, -half, 0.0), size_m=(_SIZE_M, _SIZE_M, _HEIGHT_M), reflection=0)
    playground = PlaygroundCfg(
        name="arena",
        rooms=[room],
        props=list(props),
        floor_size_m=(_SIZE_M, _SIZE_M),
        image_order=0,
    )
    world = World(playground, ClockCfg(substeps=substeps))
    world.freeze()
    world.reset(np.random.default_rng(0))
    return world


def simulate(world: World, seconds: float, record: Callable[[], None] | None = None) -> None:
    """Advance a world by whole agent steps.

    Args:
        world: The world.
        seconds: How long; rounded to agent steps.
        record: Called after every physics step.
    """
    if record is not None:
        world.after_substep.append(record)
    for _ in range(round(seconds / world.clock.step_s)):
        world.step()
    if record is not None:
        world.after_substep.remove(record)
