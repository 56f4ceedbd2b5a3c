"""Joint limits and inertia of joint-level bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tools.fidelity.law import Law, Section, at_most
from tools.fidelity.mechanics.momentum import body_in_the_air
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Detail, Humanoid
from veca_marl.sim.physics import World

_TEXT = """
- **Limits**: full torques of random sign drive the joints of a body in the air; angles and speeds
  are read from Bullet after every physics step.
- **Mass matrix**: the composite-rigid-body algorithm (Featherstone 2008) against Bullet's own mass
  matrix in random postures, relative to the diagonal.
- **Inertia**: moment of inertia of the standing body about its long axis. That of its bones is
  0.028 kg m^2; links of fingers, forearms, hands, feet, neck and head have more inertia than these
  bones, see the reference of bodies.
"""
_INERTIA_KG_M2 = 0.032
_TOP_SPEED_RADPS = 30.0


@dataclass(frozen=True)
class Extremes:
    """What joints reached in a trial.

    Attributes:
        beyond_rad: Largest angle beyond a limit; not above 0 if no joint passed one.
        speed_radps: Largest speed.
        at_limits: How many joints were within 0.012 rad of a limit at some time.
    """

    beyond_rad: float
    speed_radps: float
    at_limits: int


def drive_against_limits(detail: Detail, seed: int, seconds: float) -> Extremes:
    """Apply full torques of random sign to a body in the air.

    Args:
        detail: Level of detail of the body.
        seed: Of the torques, which are constant for one agent step.
        seconds: Duration.
    """
    world, body = body_in_the_air(detail, 0.0)
    seen: list[tuple[list[float], list[float]]] = []
    world.after_substep.append(lambda: seen.append(_joints_in_bullet(world, body)))
    rng = np.random.default_rng(seed)
    for _ in range(round(seconds / world.clock.step_s)):
        body.apply_torque(rng.choice([-1.0, 1.0], 82))
        world.step()
    angles, speeds = (np.array([row[k] for row in seen]) for k in (0, 1))
    joints = [load_skeleton().joints[joint] for joint in body.articulation.moving]
    low, high = (np.array([getattr(j, end) for j in joints]) for end in ("low_rad", "high_rad"))
    world.close()
    gaps = np.minimum(angles - low, high - angles)
    reached = int((gaps.min(axis=0) < 0.012).sum())
    return Extremes(float(-gaps.min()), float(np.abs(speeds).max()), reached)


def _joints_in_bullet(world: World, body: Humanoid) -> tuple[list[float], list[float]]:
    """Return angles and speeds of the moving joints, in the order of all joints."""
    names, found = list(body.joint_names), {}
    for link in range(world.client.getNumJoints(body.body_id)):
        name = world.client.getJointInfo(body.body_id, link).name.decode()
        if name in names:
            state = world.client.getJointState(body.body_id, link)
            found[names.index(name)] = state
    ordered = [found[index] for index in sorted(found)]
    return [state.position for state in ordered], [state.velocity for state in ordered]


def mass_matrix_error(detail: Detail, postures: int) -> float:
    """Return the largest difference from Bullet's mass matrix, relative to the diagonal."""
    world, body = body_in_the_air(detail, 0.0)
    joints, rng, errors = load_skeleton().joints, np.random.default_rng(0), []
    low, high = ([getattr(joint, end) for joint in joints] for end in ("low_rad", "high_rad"))
    for _ in range(postures):
        body.place((0.0, 0.0, 1.0), 1.0, rng.uniform(low, high))
        ours = body.articulation.dynamics.mass_matrix()[6:, 6:]
        angles = body.joint_angles()[body.articulation.moving].tolist()
        theirs = world.client.calculateMassMatrix(body.body_id, angles)
        # the base's rows have other axes in Bullet
        difference = ours - np.array(theirs)[6:, 6:]
        errors.append(np.abs(difference / np.sqrt(np.outer(np.diag(ours), np.diag(ours)))).max())
    world.close()
    return float(max(errors))


def inertia_about_the_long_axis(detail: Detail) -> float:
    """Return the moment of inertia of the standing body about the vertical, kg m^2."""
    world, body = body_in_the_air(detail, 0.0)
    inertia = float(body.articulation.dynamics.inertia_about_centre()[2, 2])
    world.close()
    return inertia


def limit_laws(detail: Detail, seconds: float) -> Iterator[Law]:
    """Yield the laws of joints that are driven against their limits."""
    found = drive_against_limits(detail, 0, seconds)
    name = f"{detail.value} body, random torques"
    yield at_most(f"largest angle beyond a joint limit, {name}", "rad", 0.0, found.beyond_rad)
    yield at_most(f"joint speed, {name}", "rad/s", _TOP_SPEED_RADPS, found.speed_radps)


def matrix_law(detail: Detail, postures: int) -> Law:
    """Return the law of the mass matrix."""
    name = f"{detail.value} body, mass matrix against Bullet"
    return at_most(name, "", 1e-5, mass_matrix_error(detail, postures))


def inertia_law(detail: Detail) -> Law:
    """Return the law of the moment of inertia about the long axis."""
    name = f"{detail.value} body, moment of inertia about the long axis"
    return at_most(name, "kg m^2", _INERTIA_KG_M2, inertia_about_the_long_axis(detail))


def section() -> Section:
    """Return the measured section."""
    laws: list[Law] = []
    for detail in Detail:
        laws += [*limit_laws(detail, 2.0), matrix_law(detail, 20), inertia_law(detail)]
    return Section("Joints", _TEXT, laws)
