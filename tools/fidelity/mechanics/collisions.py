"""Collisions of props: momentum, restitution, and rest after a fall, over time steps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_most, between
from tools.fidelity.mechanics.rigid_bodies import SUBSTEPS, make_arena, simulate
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import GRAVITY_MPS2, Prop, PropCfg, PropShape, World

_TEXT = """
- **Momentum**: two bodies (0.3 and 0.6 kg) collide off centre in free fall; the sums of linear and
  of angular momentum about the common centre of mass stay the same, and energy does not rise.
  Bullet applies the friction of a contact at two points, one on each surface, which differ by the
  penetration: with friction angular momentum changes by some percent, less at shorter steps.
- **Restitution**: balls fall on the floor from 15 heights between 0.3 and 1 m. The ratio of rebound
  and impact speed is the square root of the ratio of heights. Bullet detects contacts ahead of time
  (`clock.contact_share`) and corrects penetration with 0.2 of it per step, so that the ratio
  depends on where in a step the ball meets the floor: it is within 0.1 of the product of the
  coefficients of restitution. With a product of at most 0.8 no ball rebounds higher than it was.
- **Rest**: after a fall without rebound a ball rests on the floor.
"""
HEIGHTS_M = tuple(np.linspace(0.3, 1.0, 15).tolist())
"""Heights that balls fall from."""
RESTITUTIONS = (0.3, 0.7, 0.8)
_TOLERANCE = 0.1
_RADIUS_M = 0.05
_MASSES_KG = {"light": 0.3, "heavy": 0.6}
_SHAPES = {
    PropShape.sphere: [0.05],
    PropShape.box: [0.1, 0.08, 0.06],
    PropShape.capsule: [0.03, 0.1],
}
_DURATION_S = 0.6
_START_M = 40.0


@dataclass(frozen=True)
class Impact:
    """Changes in a collision of two props.

    Attributes:
        momentum: Change of the linear momentum, kg m/s.
        angular_momentum: Change of the angular momentum about the common centre of mass as a share
            of its amount.
        energy: Kinetic energy in the frame of the centre of mass, after over before.
    """

    momentum: float
    angular_momentum: float
    energy: float


def impact(substeps: int, shape: PropShape, friction: float) -> Impact:
    """Let two props collide off centre in free fall.

    Args:
        substeps: Physics steps per agent step of 40 ms.
        shape: Of both props.
        friction: Coefficient of both props.
    """
    places = {"light": (-0.3, 0.0, _START_M), "heavy": (0.3, 0.04, _START_M)}
    props = [
        PropCfg(
            name, shape, _SHAPES[shape], places[name], mass_kg=mass, friction=friction,
            restitution=0.8,
        )
        for name, mass in _MASSES_KG.items()
    ]  # fmt: skip
    world = make_arena(substeps, *props)
    world.prop("light").set_velocity((2.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    world.prop("heavy").set_velocity((-1.0, 0.0, 0.0))
    linear, angular, energy = _totals(world)
    simulate(world, _DURATION_S)
    linear_after, angular_after, energy_after = _totals(world)
    world.close()
    linear_after[2] += sum(_MASSES_KG.values()) * GRAVITY_MPS2 * _DURATION_S
    return Impact(
        float(np.linalg.norm(linear_after - linear)),
        float(np.linalg.norm(angular_after - angular) / np.linalg.norm(angular)),
        energy_after / energy,
    )


def _totals(world: World) -> tuple[Floats, Floats, float]:
    """Return momentum, angular momentum and energy, both about the common centre of mass."""
    props = list(world.props.values())
    masses = np.array([prop.cfg.mass_kg for prop in props])
    places = np.array([prop.position for prop in props])
    velocities = np.array([prop.velocity for prop in props])
    places = places - masses @ places / masses.sum()
    relative = velocities - masses @ velocities / masses.sum()
    angular, energy = np.zeros(3), 0.5 * float(masses @ (relative**2).sum(axis=1))
    for prop, mass, place, velocity in zip(props, masses, places, relative, strict=True):
        spin, turning = _spin(world, prop)
        angular += mass * np.cross(place, velocity) + turning
        energy += 0.5 * float(spin @ turning)
    return masses @ velocities, angular, energy


def _spin(world: World, prop: Prop) -> tuple[Floats, Floats]:
    """Return the angular velocity and the angular momentum of a prop about its centre."""
    _, spin = world.client.getBaseVelocity(prop.body_id)
    moments = world.client.getDynamicsInfo(prop.body_id, -1).moments
    rotation = prop.rotation
    return np.array(spin), rotation @ (np.array(moments) * (rotation.T @ np.array(spin)))


def rebound_ratio(substeps: int, restitution: float, height_m: float) -> float:
    """Return rebound over impact speed of a ball that falls on the floor."""
    world = make_arena(substeps, _falling_ball(restitution, height_m))
    ball, speeds, heights = world.prop("ball"), [], []

    def record() -> None:
        speeds.append(ball.velocity[2])
        place, _ = world.client.getBasePositionAndOrientation(ball.body_id)
        heights.append(place[2])

    simulate(world, 2.4 * math.sqrt(2.0 * height_m / GRAVITY_MPS2), record)
    world.close()
    rising = np.array(speeds) > 0.0
    if not rising.any():
        return 0.0
    peak = max(heights[int(np.argmax(rising)) :]) - _RADIUS_M
    return math.sqrt(max(peak, 0.0) / height_m)


def resting_depth(substeps: int) -> float:
    """Return how deep (m) a ball is in the floor, 1.6 s after the start of a fall by 0.5 m."""
    world = make_arena(substeps, _falling_ball(0.0, 0.5))
    simulate(world, 1.6)
    depth = _RADIUS_M - float(world.prop("ball").position[2])
    world.close()
    return depth


def _falling_ball(restitution: float, height_m: float) -> PropCfg:
    place = (0.0, 0.0, height_m + _RADIUS_M)
    return PropCfg(
        "ball", PropShape.sphere, [_RADIUS_M], place, mass_kg=0.3, restitution=restitution
    )


def impact_laws(substeps: int, shape: PropShape) -> Iterator[Law]:
    """Yield the laws of collisions of two props of one shape at one time step."""
    at = f"{shape.name}, step {40 / substeps:g} ms"
    smooth, rough = impact(substeps, shape, 0.0), impact(substeps, shape, 0.6)
    change = max(smooth.momentum, rough.momentum)
    yield at_most(f"change of momentum, {at}", "kg m/s", 1e-9, change)
    name = f"relative change of angular momentum, {at}"
    yield at_most(f"{name}, no friction", "", 1e-6, smooth.angular_momentum)
    limit = 0.15 * math.sqrt(SUBSTEPS[0] / substeps)
    yield at_most(f"{name}, friction 0.6", "", limit, rough.angular_momentum)
    yield at_most(f"energy after over before, {at}", "", 1.0, max(smooth.energy, rough.energy))


def rebound_laws(substeps: int, restitution: float, ratios: list[float]) -> Iterator[Law]:
    """Yield the laws of rebounds at one time step, from the ratios of all heights."""
    at = f"restitution {restitution:g}, step {40 / substeps:g} ms"
    low, high = restitution - _TOLERANCE, restitution + _TOLERANCE
    yield between(f"least ratio of rebound and impact speed, {at}", "", low, high, min(ratios))
    yield between(f"greatest ratio of rebound and impact speed, {at}", "", low, high, max(ratios))


def _rebounds(restitution: float) -> tuple[list[Law], Plot]:
    """Measure falls from all heights at all time steps with one restitution."""
    theory = [restitution] * len(HEIGHTS_M)
    laws: list[Law] = []
    curves = [Curve("restitution", HEIGHTS_M, theory, Mark.dashes)]
    for steps in SUBSTEPS:
        ratios = [rebound_ratio(steps, restitution, height) for height in HEIGHTS_M]
        laws += rebound_laws(steps, restitution, ratios)
        curves.append(Curve(f"step {40 / steps:g} ms", HEIGHTS_M, ratios, Mark.points))
    title = f"Rebound over impact speed, restitution {restitution:g}"
    return laws, Plot(title, "height of fall (m)", "ratio", curves)


def section() -> Section:
    """Return the measured section."""
    laws = [law for shape in _SHAPES for steps in SUBSTEPS for law in impact_laws(steps, shape)]
    plots = []
    for restitution in RESTITUTIONS:
        rebounds, plot = _rebounds(restitution)
        laws += rebounds
        plots.append(plot)
    for steps in SUBSTEPS:
        name = f"depth of a resting ball, step {40 / steps:g} ms"
        laws.append(between(name, "m", -1e-4, 1e-4, resting_depth(steps)))
    return Section("Collisions", _TEXT, laws, plots)
