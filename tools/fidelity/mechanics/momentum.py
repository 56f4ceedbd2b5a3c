"""Momentum and energy of joint-level bodies that nothing touches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.fidelity.law import Curve, Law, Plot, Section, at_most
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import GRAVITY_MPS2, PlaygroundCfg, World
from veca_marl.sim.physics.bullet_client import pybullet

_TEXT = """
A joint-level body far above the floor. Momentum, angular momentum about the centre of mass and
kinetic energy are sums over the links as Bullet reports them.

- **Momentum**: without weight, random torques of all joints for 4 s, which drive many joints
  against their limits. Internal torques change neither momentum nor angular momentum.
- **Free fall**: the same with weight: the centre of mass falls at g t.
- **Energy**: without weight and torques, joints start with random speeds: contacts of the body with
  itself, joint limits and damping may only take energy.
"""
_HEIGHT_M = 20.0
SPEED_TOLERANCE_MPS = 1e-6
SPIN_TOLERANCE_NMS = 1e-6
ENERGY_TOLERANCE = 0.02


@dataclass(frozen=True)
class Totals:
    """Sums over all links of a body.

    Attributes:
        mass_kg: Mass.
        centre: ``(3,)`` metres, centre of mass.
        velocity: ``(3,)`` m/s, its velocity.
        angular_momentum: ``(3,)`` N m s about the centre of mass.
        energy_j: Kinetic energy.
    """

    mass_kg: float
    centre: Floats
    velocity: Floats
    angular_momentum: Floats
    energy_j: float


@dataclass(frozen=True)
class Flight:
    """A body in the air, once per agent step.

    Attributes:
        speed_error_mps: ``(t,)`` speed of the centre of mass relative to theory.
        path_error_m: ``(t,)`` distance of the centre of mass from theory.
        angular_momentum_nms: ``(t,)`` about the centre of mass; 0 in theory.
        energy_j: ``(t,)`` kinetic energy.
    """

    speed_error_mps: Floats
    path_error_m: Floats
    angular_momentum_nms: Floats
    energy_j: Floats


def totals(world: World, body: Humanoid) -> Totals:
    """Return sums over the links of a body from Bullet's own state."""
    rows = _link_rows(world, body)
    masses = np.array([row[0] for row in rows])
    centres, velocities, spins = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
    inertias = np.array([row[4] for row in rows])
    mass = float(masses.sum())
    centre, velocity = masses @ centres / mass, masses @ velocities / mass
    own = np.einsum("nij,nj->ni", inertias, spins)
    orbits = np.cross(centres - centre, velocities - velocity)
    energy = 0.5 * float(masses @ (velocities**2).sum(axis=1) + (own * spins).sum())
    return Totals(mass, centre, velocity, own.sum(axis=0) + masses @ orbits, energy)


def _link_rows(world: World, body: Humanoid) -> list[tuple[float, Floats, Floats, Floats, Floats]]:
    """Return mass, centre, velocity, angular velocity and inertia of each link, world axes."""
    client, body_id = world.client, body.body_id
    links = list(range(client.getNumJoints(body_id)))
    place, turn = client.getBasePositionAndOrientation(body_id)
    velocity, spin = client.getBaseVelocity(body_id)
    states = client.getLinkStates(body_id, links, 1, 1)
    motions = [(place, turn, velocity, spin)]
    motions += [(s.centre, s.centre_orientation, s.velocity, s.angular_velocity) for s in states]
    rows = []
    for link, (centre, quaternion, *speeds) in zip([-1, *links], motions, strict=True):
        dynamics = client.getDynamicsInfo(body_id, link)
        axes = np.reshape(pybullet.getMatrixFromQuaternion(quaternion), (3, 3))
        inertia = axes @ np.diag(dynamics.moments) @ axes.T
        linear, angular = map(np.array, speeds)
        rows.append((dynamics.mass_kg, np.array(centre), linear, angular, inertia))
    return rows


def driven_flight(detail: Detail, seed: int, seconds: float, gravity_mps2: float = 0.0) -> Flight:
    """Apply random torques to all joints of a body in the air.

    Args:
        detail: Level of detail of the body.
        seed: Of the torques, which are uniform and constant for one agent step.
        seconds: Duration.
        gravity_mps2: Acceleration downward.
    """
    world, body = body_in_the_air(detail, gravity_mps2)
    rng = np.random.default_rng(seed)
    return _fly(world, body, seconds, gravity_mps2, lambda: rng.uniform(-1.0, 1.0, 82))


def unpowered_flight(detail: Detail, seed: int, seconds: float, spread_radps: float) -> Flight:
    """Let a body fly from random joint speeds, without torques and weight.

    Args:
        detail: Level of detail of the body.
        seed: Of the speeds.
        seconds: Duration.
        spread_radps: Standard deviation of the speeds.
    """
    world, body = body_in_the_air(detail, 0.0)
    joints = body.articulation
    joints.set_speeds(np.random.default_rng(seed).normal(0.0, spread_radps, 82))
    joints.read()
    return _fly(world, body, seconds, 0.0, lambda: np.zeros(82))


def body_in_the_air(detail: Detail, gravity_mps2: float) -> tuple[World, Humanoid]:
    """Return a world with a body 20 m above the floor, driven by torques."""
    world = World(PlaygroundCfg())
    body = Humanoid("child", HumanoidCfg(detail=detail), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.client.setGravity(0.0, 0.0, -gravity_mps2)
    body.place((0.0, 0.0, _HEIGHT_M))
    return world, body


def _fly(
    world: World, body: Humanoid, seconds: float, gravity_mps2: float, torques: Callable[[], Floats]
) -> Flight:
    """Step the world and compare with theory, which starts with the body's own motion."""
    start = totals(world, body)
    down, rows = np.array((0.0, 0.0, -gravity_mps2)), []
    for step in range(round(seconds / world.clock.step_s) + 1):
        if step > 0:
            body.apply_torque(torques())
            world.step()
        rows.append(_errors(start, totals(world, body), down, step * world.clock.step_s, world))
    world.close()
    return Flight(*np.array(rows).T)


def _errors(
    start: Totals, now: Totals, down: Floats, time_s: float, world: World
) -> tuple[float, float, float, float]:
    """Return a row of `Flight`: semi-implicit integration falls g t (t + dt) / 2."""
    path = time_s * start.velocity + 0.5 * time_s * (time_s + world.clock.substep_s) * down
    return (
        float(np.linalg.norm(now.velocity - start.velocity - time_s * down)),
        float(np.linalg.norm(now.centre - start.centre - path)),
        float(np.linalg.norm(now.angular_momentum - start.angular_momentum)),
        now.energy_j,
    )


def momentum_laws(detail: Detail, flight: Flight) -> Iterator[Law]:
    """Yield the laws of a flight with torques and without weight."""
    speed, spin = flight.speed_error_mps.max(), flight.angular_momentum_nms.max()
    name = f"{detail.value} body, random torques without weight"
    yield at_most(f"speed of the centre of mass, {name}", "m/s", SPEED_TOLERANCE_MPS, float(speed))
    yield at_most(f"angular momentum, {name}", "N m s", SPIN_TOLERANCE_NMS, float(spin))


def fall_laws(detail: Detail, seconds: float = 1.0) -> Iterator[Law]:
    """Yield the laws of free fall under random torques."""
    flight = driven_flight(detail, 0, seconds, GRAVITY_MPS2)
    speed, path = float(flight.speed_error_mps.max()), float(flight.path_error_m.max())
    yield at_most(f"{detail.value} body, free fall, speed error", "m/s", SPEED_TOLERANCE_MPS, speed)
    yield at_most(f"{detail.value} body, free fall, path error", "m", SPEED_TOLERANCE_MPS, path)


def energy_laws(detail: Detail, flights: Sequence[Flight]) -> Iterator[Law]:
    """Yield the law of flights without torques."""
    worst = max(rise_of_energy(flight) for flight in flights)
    name = f"{detail.value} body, unpowered: greatest rise of energy above the least before it"
    yield at_most(name, "", ENERGY_TOLERANCE, worst)


def rise_of_energy(flight: Flight) -> float:
    """Return the greatest rise of energy above its least value before, relative to that value.

    Damping takes energy for the whole flight, so that a comparison with the first value alone
    would permit rises later.
    """
    least = np.minimum.accumulate(flight.energy_j)
    return float((flight.energy_j / least).max()) - 1.0


def section() -> Section:
    """Return the measured section."""
    laws: list[Law] = []
    energies = []
    for detail in Detail:
        driven = [driven_flight(detail, seed, 4.0) for seed in range(3)]
        free = [unpowered_flight(detail, seed, 2.0, 3.0) for seed in range(3)]
        laws += momentum_laws(detail, _worst(driven))
        laws += [*fall_laws(detail), *energy_laws(detail, free)]
        shares = free[0].energy_j / free[0].energy_j[0]
        energies.append(Curve(detail.value, _times(free[0]), shares.tolist()))
    plot = Plot("Energy of an unpowered body", "time (s)", "share of the first", energies)
    return Section("Momentum and energy of a free body", _TEXT, laws, [plot])


def _worst(flights: Sequence[Flight]) -> Flight:
    """Return the largest numbers of several flights of equal length."""
    columns = (
        "speed_error_mps",
        "path_error_m",
        "angular_momentum_nms",
        "energy_j",
    )
    return Flight(*(np.max([getattr(f, name) for f in flights], axis=0) for name in columns))


def _times(flight: Flight) -> list[float]:
    return [0.04 * step for step in range(len(flight.energy_j))]
