"""A body with fixed arms, and balls that press on its skin, over physics steps of 8 to 1 ms.

Touch readings depend on geometry alone, solver forces on the physics step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, at_most
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import (
    GRAVITY_MPS2,
    ClockCfg,
    PlaygroundCfg,
    Prop,
    PropCfg,
    PropShape,
    RoomCfg,
    World,
)
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.touch import TouchCfg, TouchSense, load_taxels

_FIXING_N = 1e5
_ITERATIONS = 300  # of Bullet's solver
_ASIDE_M = 20.0
# flat hands with the thumb out of the ball's path
_POSTURE: dict[str, float] = {
    "upper_arm.abduction": 45.0,
    "thumb_metacarpal.flexion": -20.0,
    "thumb_metacarpal.abduction": -10.0,
    **{f"{finger}_proximal.flexion": -40.0 for finger in ("index", "middle", "ring", "little")},
}


@dataclass(frozen=True)
class Spot:
    """A place on an arm: a point on the surface of a bone and the outward normal, in its frame."""

    bone: str
    point_m: tuple[float, float, float]
    outward: tuple[float, float, float]


# on the surface of the box and of the capsule that are these bones in the table of bones
PALM = Spot("l_hand", (0.0, -0.006, -0.0265), (0.0, -1.0, 0.0))
RIGHT_PALM = Spot("r_hand", (0.0, 0.006, -0.0265), (0.0, 1.0, 0.0))
FOREARM = Spot("l_forearm", (0.0135, 0.0, -0.0475), (1.0, 0.0, 0.0))


@dataclass(frozen=True)
class Ball:
    """A ball that falls onto the skin."""

    mass_kg: float = 0.2
    radius_m: float = 0.05


@dataclass(frozen=True)
class Press:
    """Readings and solver forces after every physics step.

    Attributes:
        touch: ``(n,)`` the largest reading on the bone.
        force_n: ``(n,)`` normal forces between ball and body.
        readings: ``(1648, 6)`` all taxels, at the end.
    """

    touch: Floats
    force_n: Floats
    readings: Floats


class FixedArms:
    """A body with fixed arm bones, and balls that press on them.

    Only the balls have weight, and they move along the normal only, so that they touch the same
    point of the skin for every time step.

    Args:
        clock: The clock, which contains the time step.
        balls: The balls, used one after the other or together.
    """

    def __init__(self, clock: ClockCfg, *balls: Ball) -> None:
        room = RoomCfg(lower_m=(-50.0, -5.0, 0.0), size_m=(100.0, 10.0, 5.0))
        playground = PlaygroundCfg(name="empty", rooms=[room], props=[], image_order=0)
        self.world = World(playground, clock)
        # with the default number the constraint of a hand yields at 8 ms under a ball of 1.5 kg
        self.world.require_solver_iterations(_ITERATIONS)
        self._body = Humanoid("child", HumanoidCfg(), self.world)
        self._props = {ball: self.world.add_prop(_prop(ball)) for ball in balls}
        self._sense = TouchSense(TouchCfg(), self._body, self.world)
        self.world.freeze()

    def press(
        self, seconds: float, fall_m: float, *pressed: tuple[Spot, Ball], watch: bool = True
    ) -> list[Press]:
        """Let balls fall onto spots; return readings and forces of each if `watch` is set."""
        world, body = self.world, self._body
        world.reset(np.random.default_rng(0))
        body.place((0.0, 0.0, 1.0), 0.0, Posture(0.0, _POSTURE))
        for i, prop in enumerate(self._props.values()):
            prop.place((_ASIDE_M + i, 0.0, 1.0))
        world.client.setGravity(0.0, 0.0, 0.0)
        constraints = [self._fix(spot.bone) for spot, _ in pressed]
        falls = [_Fall(self, spot, self._props[ball], ball, fall_m) for spot, ball in pressed]
        world.after_substep.extend(fall.note if watch else fall.accelerate for fall in falls)
        for _ in range(round(seconds * world.clock.control_rate_hz)):
            world.step()
        del world.after_substep[-len(falls) :]
        for constraint in constraints:
            world.client.removeConstraint(constraint)
        readings = self.read().copy()
        return [Press(np.array(f.touch), np.array(f.force_n), readings) for f in falls]

    def read(self) -> Floats:
        """Return the present readings of all taxels."""
        self.world.refresh()
        return self._sense.update_taxels()

    def largest(self, bone: str) -> float:
        """Return the largest of the present readings on a bone."""
        index, first = load_skeleton().bone(bone), load_taxels().first_triangle
        return float(self.read()[first[index] : first[index + 1]].max())

    def pose(self, spot: Spot) -> tuple[Floats, Floats]:
        """Return the position of a spot and the outward normal, world frame."""
        bone = self._body.bone(spot.bone)
        out = bone.rotation @ np.array(spot.outward)
        return bone.position + bone.rotation @ np.array(spot.point_m), out

    def force_n(self, prop: Prop) -> float:
        """Return the normal forces between a ball and the body."""
        points = self.world.client.getContactPoints(prop.body_id, self._body.body_id)
        return math.fsum(point.normal_force_n for point in points)

    def _fix(self, bone: str) -> int:
        """Fix a bone in its present pose."""
        client, body_id = self.world.client, self._body.body_id
        names = [
            client.getJointInfo(body_id, link).link_name.decode()
            for link in range(client.getNumJoints(body_id))
        ]
        link = names.index(bone)
        state = client.getLinkState(body_id, link, 0, 1)
        ends = ((0.0, 0.0, 0.0), state.centre, (0.0, 0.0, 0.0, 1.0), state.centre_orientation)
        constraint = client.createConstraint(
            body_id, link, -1, -1, pybullet.JOINT_FIXED, (0, 0, 0), *ends
        )
        client.changeConstraint(constraint, maxForce=_FIXING_N)
        return int(constraint)


class _Fall:
    """One ball above one spot."""

    def __init__(self, arms: FixedArms, spot: Spot, prop: Prop, ball: Ball, fall_m: float) -> None:
        self._arms, self._prop, self._bone = arms, prop, spot.bone
        self.touch: list[float] = []
        self.force_n: list[float] = []
        self._point, self._out = arms.pose(spot)
        skeleton = load_skeleton()
        skin_m = skeleton.bones[skeleton.bone(spot.bone)].skin_thickness_m
        prop.place(self._point + (skin_m + ball.radius_m + fall_m) * self._out)
        self.accelerate()

    def note(self) -> None:
        """Record readings and forces after a physics step."""
        self.force_n.append(self._arms.force_n(self._prop))
        self.touch.append(self._arms.largest(self._bone))
        self.accelerate()

    def accelerate(self) -> None:
        """Accelerate the ball towards the skin by g, and constrain it to the normal."""
        world, body_id = self._arms.world, self._prop.body_id
        velocity, _ = world.client.getBaseVelocity(body_id)
        along = np.dot(velocity, self._out) - GRAVITY_MPS2 * world.clock.substep_s
        centre, turn = world.client.getBasePositionAndOrientation(body_id)
        on_normal = self._point + np.dot(centre - self._point, self._out) * self._out
        world.client.resetBasePositionAndOrientation(body_id, on_normal, turn)
        world.client.resetBaseVelocity(body_id, along * self._out, (0.0, 0.0, 0.0))


def _prop(ball: Ball) -> PropCfg:
    name = f"ball of {ball.mass_kg} kg and {ball.radius_m} m"
    return PropCfg(name, PropShape.sphere, [ball.radius_m], mass_kg=ball.mass_kg, restitution=0.0)


MASSES_KG = (0.05, 0.2, 0.5, 1.5)
SPOTS = {"palm": PALM, "forearm": FOREARM}
DEFAULT_SHARE, LARGE_SHARE = 0.02, 0.1
"""Values of `ClockCfg.contact_share`, which is how early Bullet detects a contact."""
SLOW_FALL_M = 0.002
_SUBSTEPS = (5, 10, 20, 40)
_AT_REST_AFTER_S = 0.8


def clocks(contact_share: float) -> list[ClockCfg]:
    """Return clocks with physics steps of 8, 4, 2 and 1 ms."""
    return [ClockCfg(substeps=substeps, contact_share=contact_share) for substeps in _SUBSTEPS]


def readings_at_rest(clocks: Sequence[ClockCfg]) -> dict[str, Floats]:
    """Return the largest reading under balls of `MASSES_KG` at rest, ``(clocks, masses)``.

    Returns:
        The readings on each of `SPOTS`.
    """
    balls = [Ball(mass_kg) for mass_kg in MASSES_KG]
    rows: dict[str, list[list[float]]] = {name: [] for name in SPOTS}
    for clock in clocks:
        arms = FixedArms(clock, *balls)
        for name, spot in SPOTS.items():
            rows[name].append([_at_rest(arms, spot, ball) for ball in balls])
        arms.world.close()
    return {name: np.array(row) for name, row in rows.items()}


def _at_rest(arms: FixedArms, spot: Spot, ball: Ball) -> float:
    arms.press(_AT_REST_AFTER_S, 0.0, (spot, ball), watch=False)
    return arms.largest(spot.bone)


def peaks(
    spot: Spot, ball: Ball, clocks: Sequence[ClockCfg], fall_m: float = 0.02
) -> tuple[Floats, Floats]:
    """Return the peaks of touch and of force (N) of a fall, for each clock."""
    falls = []
    for clock in clocks:
        arms = FixedArms(clock, ball)
        falls += arms.press(0.2, fall_m, (spot, ball))
        arms.world.close()
    return (
        np.array([fall.touch.max() for fall in falls]),
        np.array([fall.force_n.max() for fall in falls]),
    )


def spread(readings: Floats) -> float:
    """Return the largest ratio of readings at different physics steps, ``(clocks, ...)``."""
    return float((readings.max(axis=0) / readings.min(axis=0)).max())


def rest_laws(readings: dict[str, Floats]) -> Iterator[Law]:
    """Yield the laws that readings at rest do not depend on the physics step."""
    for name, of_spot in readings.items():
        law = f"T at rest on the {name}, 0.05 to 1.5 kg: largest ratio over steps of 8 to 1 ms"
        yield at_most(law, "", 1.01, spread(of_spot))


def impacts() -> dict[str, Floats]:
    """Return the peaks of T of a ball of 0.2 kg that falls on the skin, at each physics step."""
    default, large = clocks(DEFAULT_SHARE), clocks(LARGE_SHARE)
    return {
        "palm, fall of 2 mm": peaks(PALM, Ball(), default, SLOW_FALL_M)[0],
        "palm, fall of 20 mm, contact_share=0.1": peaks(PALM, Ball(), large)[0],
        "forearm (rigid), fall of 20 mm": peaks(FOREARM, Ball(), default)[0],
        "palm, fall of 20 mm": peaks(PALM, Ball(), default)[0],
    }


LIMITS = {
    "palm, fall of 2 mm": 1.2,
    "palm, fall of 20 mm, contact_share=0.1": 1.4,
    "forearm (rigid), fall of 20 mm": 1.05,
}
"""Largest ratios of peaks; a fall of 20 mm on the palm at the default `contact_share` has none."""


def impact_laws(found: dict[str, Floats]) -> Iterator[Law]:
    """Yield the laws of the peaks of `impacts`."""
    for name, limit in LIMITS.items():
        law = f"peak of T, {name}: largest ratio over steps of 8 to 1 ms"
        yield at_most(law, "", limit, spread(found[name]))


def impact_plot(found: dict[str, Floats]) -> Plot:
    """Return the peaks of `impacts` over the physics step."""
    step_ms = [1000.0 * clock.substep_s for clock in clocks(DEFAULT_SHARE)]
    curves = [Curve(name, step_ms, peak.tolist(), Mark.line) for name, peak in found.items()]
    return Plot(
        "Peak of T of a ball of 0.2 kg", "physics step (ms)", "peak of T", curves, log_x=True
    )
