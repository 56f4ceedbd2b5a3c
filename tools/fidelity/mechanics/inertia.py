"""Inertia of every shape of prop, by the response to a torque and by the period of a pendulum."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, equals
from tools.fidelity.mechanics.rigid_bodies import SUBSTEPS, make_arena, simulate
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import GRAVITY_MPS2, PropCfg, PropShape, World
from veca_marl.sim.physics.bullet_client import pybullet

_TEXT = """
- **Response to a torque**: a torque about an axis of symmetry acts on a prop of 1 kg for one
  physics step; the inertia is the torque times the duration over the angular velocity. Theory:
  moments of homogeneous solids about the centre of mass, for a goal the sum of two posts and a bar
  by the parallel axis theorem, with masses in proportion to volumes.
- **Centre of mass**: a spinning prop in free fall turns about its centre of mass, whose path is
  that of a point; walls and goals have their frame at the foot.
- **Pendulum**: a rod (capsule of radius r = 30 mm, l = 0.6 m between the centres of its caps) hangs
  at the centre of a cap and swings by 5 degrees. Its period is 2 pi sqrt(I / (m g l / 2)), with I
  about the pivot, times 1 + a^2 / 16 for the amplitude a in radians.
"""
SIZES: dict[PropShape, list[float]] = {
    PropShape.sphere: [0.1],
    PropShape.box: [0.1, 0.2, 0.3],
    PropShape.cylinder: [0.1, 0.4],
    PropShape.capsule: [0.1, 0.4],
    PropShape.wall: [1.0, 0.1, 0.5],
    PropShape.goal: [1.0, 0.5, 0.05],
}
"""Sizes (m) of the props that are measured."""
_TORQUE_NM = 0.01
_HEIGHT_M = 10.0
_ROD = (0.03, 0.6)
_AMPLITUDE_RAD = math.radians(5.0)
_PERIODS_S = 16.0


def _prop(shape: PropShape) -> PropCfg:
    return PropCfg("prop", shape, SIZES[shape], (0.0, 0.0, _HEIGHT_M), mass_kg=1.0)


def measured_inertia(shape: PropShape) -> Floats:
    """Return the moments of inertia (kg m^2) of a prop of 1 kg about x, y and z, ``(3,)``."""
    world = make_arena(SUBSTEPS[0], _prop(shape))
    prop, moments = world.prop("prop"), np.zeros(3)
    for axis in range(3):
        prop.place((0.0, 0.0, _HEIGHT_M))
        torque = (_TORQUE_NM * np.eye(3)[axis]).tolist()
        world.client.applyExternalTorque(prop.body_id, -1, torque, pybullet.WORLD_FRAME)
        world.client.stepSimulation()
        _, spin = world.client.getBaseVelocity(prop.body_id)
        moments[axis] = _TORQUE_NM * world.clock.substep_s / spin[axis]
    world.close()
    return moments


def expected_inertia(shape: PropShape) -> Floats:
    """Return the moments of inertia (kg m^2) that theory gives, ``(3,)``."""
    size = SIZES[shape]
    match shape:
        case PropShape.sphere:
            return np.full(3, 0.4 * size[0] ** 2)
        case PropShape.box | PropShape.wall:
            return _box(size)
        case PropShape.cylinder:
            return _cylinder(*size)
        case PropShape.capsule:
            return _capsule(*size)
        case PropShape.goal:
            return _goal(*size)
        case _:
            raise ValueError(f"shape={shape}: no formula; there are {[one.name for one in SIZES]}")


def _box(edges: Sequence[float]) -> Floats:
    x, y, z = edges
    return np.array([y**2 + z**2, x**2 + z**2, x**2 + y**2]) / 12.0


def _cylinder(radius: float, length: float) -> Floats:
    across = radius**2 / 4.0 + length**2 / 12.0
    return np.array([across, across, radius**2 / 2.0])


def _capsule(radius: float, length: float) -> Floats:
    """Return those of a cylinder and two half balls.

    The centre of mass of a half ball is 3/8 r from its plane.
    """
    tube, ball = radius**2 * length, 4.0 / 3.0 * radius**3
    share = ball / (tube + ball)
    about_own_centre = (0.4 - (3.0 / 8.0) ** 2) * radius**2
    across = about_own_centre + (length / 2.0 + 3.0 / 8.0 * radius) ** 2
    caps = np.array([across, across, 0.4 * radius**2])
    return (1.0 - share) * _cylinder(radius, length) + share * caps


def _goal(width: float, height: float, radius: float) -> Floats:
    """Return those of two posts of one height at both ends of a bar of the goal's width."""
    post, bar = height / (2.0 * height + width), width / (2.0 * height + width)
    centre = 2.0 * post * height / 2.0 + bar * height
    x, y, z = 2.0 * post * _cylinder(radius, height) + bar * _cylinder(radius, width)[[0, 2, 1]]
    up = 2.0 * post * (height / 2.0 - centre) ** 2 + bar * (height - centre) ** 2
    aside = 2.0 * post * (width / 2.0) ** 2
    return np.array([x + up + aside, y + up, z + aside])


def centre_of_mass_error(shape: PropShape) -> float:
    """Return how far (m) the centre of mass leaves the vertical while a spinning prop falls."""
    world = make_arena(SUBSTEPS[0], _prop(shape))
    prop = world.prop("prop")
    prop.set_velocity((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    centre = np.array([0.0, 0.0, _centre_height(shape)])
    simulate(world, 0.6)
    where = prop.position + prop.rotation @ centre
    world.close()
    return float(np.hypot(where[0], where[1]))


def _centre_height(shape: PropShape) -> float:
    """Return the height (m) of the centre of mass over the origin of the frame of a prop."""
    if shape is PropShape.wall:
        return SIZES[shape][2] / 2.0
    if shape is PropShape.goal:
        width, height, _ = SIZES[shape]
        return (height**2 + width * height) / (2.0 * height + width)
    return 0.0


def pendulum_period(substeps: int) -> float:
    """Return the period (s) of a rod that swings by 5 degrees."""
    world = make_arena(substeps, PropCfg("rod", PropShape.capsule, [*_ROD], mass_kg=1.0))
    _hang(world)
    body_id, path = world.prop("rod").body_id, []

    def record() -> None:
        place, _ = world.client.getBasePositionAndOrientation(body_id)
        path.append(place[0])

    simulate(world, _PERIODS_S, record)
    world.close()
    x = np.array(path)
    before = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossings = before - x[before] / (x[before + 1] - x[before])
    return float(np.diff(crossings).mean() * world.clock.substep_s)


def _hang(world: World) -> None:
    """Fix the upper cap of the rod to a point, and deflect the rod."""
    up = np.array([0.0, 0.0, _ROD[1] / 2.0])
    pivot = np.array([0.0, 0.0, _HEIGHT_M])
    body_id = world.prop("rod").body_id
    world.client.createConstraint(
        body_id, -1, -1, -1, pybullet.JOINT_POINT2POINT, (0, 0, 0), up, pivot
    )
    turned = pybullet.getQuaternionFromEuler((0.0, _AMPLITUDE_RAD, 0.0))
    rotation = np.array(pybullet.getMatrixFromQuaternion(turned)).reshape(3, 3)
    world.client.resetBasePositionAndOrientation(body_id, (pivot - rotation @ up).tolist(), turned)


def expected_period() -> float:
    """Return the period (s) that theory gives."""
    radius, length = _ROD
    arm = length / 2.0
    inertia = _capsule(radius, length)[0] + arm**2
    amplitude = 1.0 + _AMPLITUDE_RAD**2 / 16.0
    return 2.0 * math.pi * math.sqrt(inertia / (GRAVITY_MPS2 * arm)) * amplitude


def inertia_laws(shape: PropShape) -> Iterator[Law]:
    """Yield the laws of one shape."""
    pairs = zip("xyz", expected_inertia(shape), measured_inertia(shape), strict=True)
    for axis, theory, measured in pairs:
        name = f"{shape.name}, inertia about {axis}"
        yield equals(name, "kg m^2", float(theory), float(measured), 1e-6 * float(theory))
    error = centre_of_mass_error(shape)
    yield equals(f"{shape.name}, sideways path of its centre of mass", "m", 0.0, error, 1e-9)


def pendulum_law(substeps: int) -> Law:
    """Return the law of the pendulum at one time step."""
    theory = expected_period()
    name = f"period of a rod, step {40 / substeps:g} ms"
    return equals(name, "s", theory, pendulum_period(substeps), 1e-3 * theory)


def section() -> Section:
    """Return the measured section."""
    solids = [law for shape in SIZES for law in inertia_laws(shape)]
    swings = [pendulum_law(substeps) for substeps in SUBSTEPS]
    steps_ms, theory = [40 / substeps for substeps in SUBSTEPS], expected_period()
    errors = [100 * (law.measured / theory - 1) for law in swings]
    curves = [Curve("", steps_ms, errors), Curve("", steps_ms, [0.0] * len(errors), Mark.dashes)]
    plot = Plot("Period of a rod", "physics step (ms)", "error (%)", curves)
    return Section("Inertia", _TEXT, [*solids, *swings], [plot])
