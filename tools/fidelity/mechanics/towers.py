"""Towers of cubes: whether they stand and creep, with the clock ``clock=stacking``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.fidelity.law import Law, Section, at_most
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg, PropCfg, PropShape, RoomCfg, World

STACKING = ClockCfg(substeps=10, solver_iterations=100, sleep_s=0.4)
"""The preset ``clock=stacking``."""

_TEXT = """
Cubes of 10 cm are placed upon each other and left alone for 60 s with the clock `clock=stacking`:
exactly above each other, and displaced by up to 1 cm. Theory: nothing moves. During the first two
seconds a tower settles, as contacts have to find their forces. After that its displacement in any
direction is creep. What Bullet needs for this, and why towers fall with the default clock, is on
the page of [props](props.md#towers).
"""
_EDGE_M = 0.1
_DURATION_S, _SETTLING_S = 60.0, 2.0
_OFFSET_M = 0.01
TOWERS_KG: dict[str, list[float]] = {
    "two cubes": [0.2] * 2,
    "five cubes": [0.2] * 5,
    "ten cubes": [0.2] * 10,
    "2 kg on 0.2 kg": [0.2, 2.0],
}
"""Masses of the cubes of each tower, from below."""


@dataclass(frozen=True)
class Displacements:
    """How far the cubes of a tower moved.

    Attributes:
        settling_m: Greatest distance from the start, at any time.
        creep_m: Greatest distance from the position after settling.
    """

    settling_m: float
    creep_m: float


def stand(clock: ClockCfg, masses_kg: Sequence[float], seed: int | None = None) -> Displacements:
    """Let a tower stand for a minute.

    Args:
        clock: The clock.
        masses_kg: Of its cubes, from below.
        seed: Of their displacements; None places them exactly above each other.
    """
    cubes = [
        PropCfg(
            f"cube_{n}", PropShape.box, [_EDGE_M] * 3, (0, 0, (n + 0.5) * _EDGE_M), mass_kg=mass
        )
        for n, mass in enumerate(masses_kg)
    ]
    room = RoomCfg(lower_m=(-2.0, -2.0, 0.0), size_m=(4.0, 4.0, 3.0))
    world = World(PlaygroundCfg(name="arena", rooms=[room], props=cubes, image_order=0), clock)
    world.freeze()
    world.reset(np.random.default_rng(0))
    if seed is not None:
        _displace(world, np.random.default_rng(seed))
    start = settled = _places(world)
    settling_m = creep_m = 0.0
    for step in range(round(_DURATION_S / clock.step_s)):
        world.step()
        places = _places(world)
        settling_m = max(settling_m, _distance_m(places, start))
        if (step + 1) * clock.step_s <= _SETTLING_S:
            settled = places
        creep_m = max(creep_m, _distance_m(places, settled))
    world.close()
    return Displacements(settling_m, creep_m)


def _displace(world: World, rng: np.random.Generator) -> None:
    for prop in world.props.values():
        x, y = rng.uniform(-_OFFSET_M, _OFFSET_M, 2)
        prop.place((x, y, prop.position[2]), rng.uniform(-0.1, 0.1))


def _places(world: World) -> Floats:
    """Return the positions of all cubes, ``(n, 3)`` metres."""
    return np.array([prop.position for prop in world.props.values()])


def _distance_m(places: Floats, others: Floats) -> float:
    return float(np.linalg.norm(places - others, axis=1).max())


def laws(name: str) -> Iterator[Law]:
    """Yield the laws of one of `TOWERS_KG`."""
    for how, seed in (("exact", None), ("displaced", 0)):
        moved = stand(STACKING, TOWERS_KG[name], seed)
        yield at_most(f"settling of {name}, {how}", "mm", 10.0, 1e3 * moved.settling_m)
        yield at_most(f"creep of {name} in 60 s, {how}", "mm", 1.0, 1e3 * moved.creep_m)


def section() -> Section:
    """Return the measured section."""
    return Section("Towers", _TEXT, [law for name in TOWERS_KG for law in laws(name)])
