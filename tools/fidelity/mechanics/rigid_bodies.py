"""Single rigid bodies: free fall, sliding and rolling, over an 8-fold range of time steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, equals
from veca_marl.sim.physics import (
    GRAVITY_MPS2,
    ClockCfg,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    RoomCfg,
    World,
)

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


_TEXT = """
One prop in an empty world, at physics steps of 8 (the default), 4, 2 and 1 ms.

- **Free fall**: v = g t. Bullet integrates semi-implicitly, so that after the time t a body has
  fallen g t (t + dt) / 2.
- **Sliding**: a box with speed v stops after v^2 / (2 mu g) (Coulomb friction).
- **Sliding into rolling**: a ball that starts at v without spin rolls at 5/7 v, because its angular
  momentum about the line of contact is conserved.
- **Rolling resistance**: a rolling ball of radius r with the lever arm c stops after
  7 v^2 r / (10 c g).
"""
_FALL_S = 1.0
_SLIDING_MPS = 2.0
_SLIDING_FRICTION = 0.4
_BALL_RADIUS_M = 0.05
_ROLLING_MPS = 0.7
_LEVER_M = 0.001


def free_fall(substeps: int) -> tuple[float, float]:
    """Return the speed (m/s) and the path (m) of a ball after a second of free fall."""
    height_m = 8.0
    ball = PropCfg("ball", PropShape.sphere, [_BALL_RADIUS_M], (0, 0, height_m), mass_kg=0.3)
    world = make_arena(substeps, ball)
    simulate(world, _FALL_S)
    prop = world.prop("ball")
    speed, path = -float(prop.velocity[2]), height_m - float(prop.position[2])
    world.close()
    return speed, path


def sliding_distance(substeps: int) -> float:
    """Return how far (m) a box slides that starts at 2 m/s with a friction coefficient of 0.4."""
    box = PropCfg(
        "box", PropShape.box, [0.2, 0.2, 0.1], (0, 0, 0.05), mass_kg=1, friction=_SLIDING_FRICTION
    )
    return _distance(substeps, box, _SLIDING_MPS, 0.0, 2.0)


def rolling_speed(substeps: int) -> float:
    """Return the speed (m/s) of a ball that started to slide at 1 m/s, once it rolls."""
    world = make_arena(substeps, _ball(rolling_friction=0.0))
    prop = world.prop("ball")
    simulate(world, 0.4)
    prop.set_velocity((1.0, 0.0, 0.0))
    simulate(world, 1.0)
    speed = float(prop.velocity[0])
    world.close()
    return speed


def rolling_distance(substeps: int) -> float:
    """Return how far (m) a ball rolls that starts at 0.7 m/s, with a lever arm of 1 mm."""
    ball = _ball(rolling_friction=_LEVER_M)
    return _distance(substeps, ball, _ROLLING_MPS, _ROLLING_MPS / _BALL_RADIUS_M, 8.0)


def _ball(rolling_friction: float) -> PropCfg:
    return PropCfg(
        "ball",
        PropShape.sphere,
        [_BALL_RADIUS_M],
        (0.0, 0.0, _BALL_RADIUS_M),
        mass_kg=0.3,
        friction=0.5,
        rolling_friction=rolling_friction,
    )


def _distance(substeps: int, cfg: PropCfg, speed: float, spin: float, seconds: float) -> float:
    """Let a prop settle on the floor, push it along x, return how far it gets."""
    world = make_arena(substeps, cfg)
    prop = world.prop(cfg.name)
    simulate(world, 0.4)
    start = float(prop.position[0])
    prop.set_velocity((speed, 0.0, 0.0), (0.0, spin, 0.0))
    simulate(world, seconds)
    path = float(prop.position[0]) - start
    world.close()
    return path


def laws(substeps: int) -> Iterator[Law]:
    """Yield the laws at one time step."""
    step_s = 0.04 / substeps
    at = f"step {1e3 * step_s:g} ms"
    speed, path = free_fall(substeps)
    theory = GRAVITY_MPS2 * _FALL_S * (_FALL_S + step_s) / 2
    yield equals(f"speed after 1 s of free fall, {at}", "m/s", GRAVITY_MPS2, speed, 1e-9)
    yield equals(f"path after 1 s of free fall, {at}", "m", theory, path, 1e-9)
    stop = _SLIDING_MPS**2 / (2 * _SLIDING_FRICTION * GRAVITY_MPS2)
    yield equals(f"sliding distance, {at}", "m", stop, sliding_distance(substeps), 0.02 * stop)
    rolling = rolling_speed(substeps)
    yield equals(f"speed of rolling after sliding at 1 m/s, {at}", "m/s", 5 / 7, rolling, 1e-6)
    far = 0.7 * _ROLLING_MPS**2 * _BALL_RADIUS_M / (_LEVER_M * GRAVITY_MPS2)
    yield equals(f"rolling distance, {at}", "m", far, rolling_distance(substeps), 0.08 * far)


def section() -> Section:
    """Return the measured section."""
    everything = [law for substeps in SUBSTEPS for law in laws(substeps)]
    steps_ms = [40 / substeps for substeps in SUBSTEPS]
    curves = [
        Curve(name, steps_ms, [_relative_error(law) for law in everything if name in law.name])
        for name in ("sliding distance", "rolling distance")
    ]
    zero = Curve("", steps_ms, [0.0] * len(steps_ms), Mark.dashes)
    plot = Plot("Distance to a stop", "physics step (ms)", "error (%)", [*curves, zero])
    return Section("Rigid bodies", _TEXT, everything, [plot])


def _relative_error(law: Law) -> float:
    """Return the error in percent."""
    theory = law.theory or float("nan")
    return 100 * (law.measured / theory - 1)
