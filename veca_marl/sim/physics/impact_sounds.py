"""Sounds of things that hit each other, the floor or the stop of their joint."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.bullet_client import BulletClient
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.props import JointKind, Prop, PropCfg, PropShape
from veca_marl.sim.physics.props.geoms import bounding_box, prop_geoms
from veca_marl.sim.physics.props.joint import Joint
from veca_marl.sim.physics.props.rigid_body import prop_inertia
from veca_marl.sim.sound import SoundField
from veca_marl.sim.sound.modal_synthesis import (
    MATERIALS,
    Modes,
    StruckBody,
    acceleration_noise,
    bar_modes,
    sphere_modes,
)


@dataclass(frozen=True)
class JointStop:
    """What stops the motion of a joint, at the point of the prop that is farthest from a hinge.

    Attributes:
        reach: Speed of that point (m/s) per speed of the coordinate: its distance in metres from
            the axis of a hinge, 1 for a slide.
        impulse: Impulse (N s) that stops the prop, per speed of the coordinate: the moment of
            inertia about the axis divided by the distance for a hinge, the mass for a slide.
    """

    reach: float
    impulse: float


def joint_stop(cfg: PropCfg) -> JointStop:
    """Return the stop of a prop with a joint, at either end of its range."""
    joint = cfg.joint
    if joint is None:
        raise ValueError(f"prop {cfg.name!r} has no joint")
    if joint.kind is JointKind.slide:
        return JointStop(1.0, cfg.mass_kg)
    axis = np.asarray(joint.axis, np.float64)
    axis = axis / np.linalg.norm(axis)
    anchor = np.asarray(joint.anchor_m, np.float64)
    geoms = prop_geoms(cfg)
    corners = np.array(list(itertools.product(*np.transpose(bounding_box(geoms)))))
    reach = float(_distances_m(corners - anchor, axis).max())
    inertia = prop_inertia(geoms, cfg.mass_kg)
    (centre_m,) = _distances_m((inertia.centre - anchor)[None], axis)
    moment = float(axis @ inertia.matrix @ axis) + cfg.mass_kg * float(centre_m) ** 2
    return JointStop(reach, moment / reach)


def _distances_m(points: Floats, axis: Floats) -> Floats:
    """Return the distances ``(P,)`` of points ``(P, 3)`` from an axis through the origin."""
    distances: Floats = np.linalg.norm(np.cross(points, axis), axis=1)
    return distances


@dataclass
class ImpactCfg:
    """Sounds of impacts.

    Attributes:
        present: Whether things that hit each other or the floor, doors and drawers that meet the
            end of their range, and steps of walkers are heard.
        gain_per_ns: Sound pressure at 1 m per newton second of impulse.
        min_speed_mps: Least change of speed in one physics step that is heard, beside that by
            gravity, and least landing speed of a foot. A contact is silent if its impulse would
            change the speed of the lighter thing by less, or if neither thing changes by more. The
            stop of a joint is silent below that speed of the farthest point of the prop.
    """

    present: bool = False
    gain_per_ns: float = 0.2
    min_speed_mps: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("gain_per_ns", "min_speed_mps"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"impacts.{name}={value} must be positive and finite")


_GRAVITY_MPS2 = 9.81
_EDGES_ARE_SIZES = (PropShape.box, PropShape.wall)


class ImpactSounds:
    """Strikes the movable props of a world when contacts or stops of joints change their speed.

    The impulse of a strike is that of the contact without its impulse while the things were at rest
    or rolling: what lies still is silent. A hit that Bullet distributes over several physics steps
    strikes in each of them. A contact that changes the velocity of neither thing, such as the
    weight of what has been put on a thing, is silent. Doors, drawers and lids that meet the end of
    their range are struck there, at the point farthest from the hinge. Fixed props, the floor and
    bodies do not sound, and nothing sounds in the first physics step after a reset.
    """

    def __init__(
        self, cfg: ImpactCfg, clock: ClockCfg, client: BulletClient, sound: SoundField
    ) -> None:
        self._cfg = cfg
        self._clock = clock
        self._client = client
        self._sound = sound
        self._samples_per_substep = sound.step_samples / clock.substeps
        self._props: dict[int, Prop] = {}
        self._struck: dict[int, StruckBody] = {}
        self._resting: dict[tuple[int, int], float] = {}  # impulses without a hit
        self._velocities: dict[int, Floats] = {}
        self._stops: list[tuple[Joint, JointStop, StruckBody]] = []
        self._substep = 0

    def add(self, prop: Prop) -> None:
        """Let a prop sound when it is hit; nothing happens for fixed props."""
        if prop.fixed:
            return
        body = StruckBody(prop_modes(prop.cfg), self._cfg.gain_per_ns, self._sound.sample_rate_hz)
        self._props[prop.body_id], self._struck[prop.body_id] = prop, body
        prop.impact = self._sound.add_source(f"{prop.name}.impact", body)
        if prop.joint is not None:
            self._stops.append((prop.joint, joint_stop(prop.cfg), body))

    def reset(self) -> None:
        """Forget all contacts."""
        self._resting.clear()
        self._velocities.clear()
        self._substep = 0

    def after_substep(self) -> None:
        """Compare the impulses of all contacts with those at rest; see which joints were stopped.

        Joints have been stopped before (`Joint.after_substep`).
        """
        impulses, before = self._contact_impulses(), self._velocities
        self._velocities = {body: prop.velocity for body, prop in self._props.items()}
        delay = int(self._substep * self._samples_per_substep)
        resting = {}
        for pair, impulse in impulses.items():
            resting[pair] = impulse
            if self._was_hit(pair, before):
                resting[pair] = self._resting.get(pair, 0.0)
                added_ns = impulse - resting[pair]
                if added_ns > self._threshold_ns(pair):
                    self._strike(pair, added_ns, delay)
        self._resting = resting
        self._strike_stopped(delay)
        self._substep = (self._substep + 1) % self._clock.substeps

    def _strike_stopped(self, delay_samples: int) -> None:
        for joint, stop, body in self._stops:
            if joint.stop_speed * stop.reach > self._cfg.min_speed_mps:
                body.strike(joint.stop_speed * stop.impulse, delay_samples)

    def _contact_impulses(self) -> dict[tuple[int, int], float]:
        impulses: dict[tuple[int, int], float] = {}
        for point in self._client.getContactPoints():
            pair = (point.body_a, point.body_b)
            if pair[0] in self._struck or pair[1] in self._struck:
                impulse = point.normal_force_n * self._clock.substep_s
                impulses[pair] = impulses.get(pair, 0.0) + impulse
        return impulses

    def _threshold_ns(self, pair: Iterable[int]) -> float:
        """Return the impulse below which a contact of two bodies is silent.

        The weight of a thing that is put down counts as no impact.
        """
        masses = [self._props[body].cfg.mass_kg for body in pair if body in self._props]
        return min(masses) * self._least_change_mps

    def _was_hit(self, pair: Iterable[int], before: dict[int, Floats]) -> bool:
        """Return whether the velocity of one of two bodies changed by more than by its weight."""
        return any(
            math.hypot(*(self._velocities[body] - before[body])) > self._least_change_mps
            for body in pair
            if body in before
        )

    @property
    def _least_change_mps(self) -> float:
        """The change of speed of an impact, beside that by the weight of a thing."""
        return self._cfg.min_speed_mps + _GRAVITY_MPS2 * self._clock.substep_s

    def _strike(self, pair: Iterable[int], impulse_ns: float, delay_samples: int) -> None:
        for body in pair:
            if body in self._struck:
                self._struck[body].strike(impulse_ns, delay_samples)


def prop_modes(cfg: PropCfg) -> Modes:
    """Return the modes of a prop by its shape, size and material.

    A sphere rings as a solid sphere, a goal as its bar, every other shape as a free bar of its
    greatest length.
    """
    material = MATERIALS[cfg.material]
    click = acceleration_noise(equal_volume_radius_m(cfg), material.contact_s)
    if cfg.shape is PropShape.sphere:
        return sphere_modes(cfg.size_m[0], material) + click
    if cfg.shape in (PropShape.cylinder, PropShape.capsule):
        radius, length = cfg.size_m
        if cfg.shape is PropShape.capsule:
            length += 2.0 * radius
        return bar_modes(length, 0.5 * radius, material) + click
    if cfg.shape is PropShape.goal:
        width, _, radius = cfg.size_m
        return bar_modes(width, 0.5 * radius, material) + click
    shortest, _, longest = sorted(_edges_m(cfg))
    return bar_modes(longest, shortest / math.sqrt(12.0), material) + click


def equal_volume_radius_m(cfg: PropCfg) -> float:
    """Return the radius of the sphere with the volume of a prop."""
    if cfg.shape is PropShape.sphere:
        return cfg.size_m[0]
    if cfg.shape in (PropShape.cylinder, PropShape.capsule):
        radius, length = cfg.size_m
        volume = math.pi * radius**2 * length
        if cfg.shape is PropShape.capsule:
            volume += 4.0 / 3.0 * math.pi * radius**3
    elif cfg.shape in _EDGES_ARE_SIZES:
        volume = math.prod(cfg.size_m)
    else:
        volume = sum(geom.volume for geom in prop_geoms(cfg))
    return float((volume / (4.0 / 3.0 * math.pi)) ** (1.0 / 3.0))


def _edges_m(cfg: PropCfg) -> list[float]:
    """Return the edges of the box about a prop."""
    if cfg.shape in _EDGES_ARE_SIZES:
        return list(cfg.size_m)
    low, high = bounding_box(prop_geoms(cfg))
    return [float(edge) for edge in high - low]
