"""Corrections of Bullet's contacts: props that would pass through things, and too fast rebounds.

Bullet looks for contacts where things are at the beginning of a physics step. Its own continuous
collision detection (`ccdSweptSphereRadius`) moves rigid bodies only, and props are multibodies.
Hence a prop that would move by more than half its size in a physics step, and whose centre would
meet something in it, is moved there before the step: Bullet finds the contact and solves it with
the whole velocity. The prop is early by less than a physics step.

Bullet adds a fraction of the penetration, over the time step, to the speed of a rebound
(`contactERP`, 0.2). As the penetration is up to the way of one step, a ball would rebound with up
to its restitution plus 0.2 of its speed: with a restitution of 1 it would rise higher every time.
What is too fast is taken away after the physics step by an impulse at the contact, with its
reaction on the other thing. The speed before the physics step is the reference, without the weight
of this step: Bullet's integration keeps the height that a ball reaches exactly then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Floats, Scene, quaternions_to_matrices
from veca_marl.sim.physics.bullet import free_path_m
from veca_marl.sim.physics.bullet_client import BulletClient, ContactPoint
from veca_marl.sim.physics.props.prop import Prop

# props that are too large to pass through things at the speed after a fall of 5 m are ignored
_FASTEST_MPS = 10.0
_FAST = 0.5  # of the speed from which a prop could pass through: it may gain speed in a step
_DEPTH_M = 1e-5  # in what it meets, so that Bullet finds the contact


class FastProps:
    """The props of one world that can be too fast, and what keeps them on their side of things.

    Args:
        client: The PyBullet client.
        scene: Where the props are at the end of an agent step.
        substep_s: Duration of a physics step.
    """

    def __init__(self, client: BulletClient, scene: Scene, substep_s: float) -> None:
        self._client, self._scene, self._substep_s = client, scene, substep_s
        self._small: list[Prop] = []
        self._fast: list[Prop] = []
        self._rows: list[int] = []
        self._moved_m, self._positions = np.zeros(0), np.zeros((0, 3))

    def add(self, prop: Prop) -> None:
        """Add a prop, if it is loose and small enough to be too fast."""
        is_small = prop.half_size_m < _FASTEST_MPS * self._substep_s
        if is_small and not prop.fixed and prop.joint is None:
            self._small.append(prop)
            self._rows.append(prop.row)
            self._moved_m = np.array([_FAST * each.half_size_m for each in self._small])
            self._positions = np.full((len(self._rows), 3), np.inf)

    def before_step(self) -> None:
        """Find the props that are fast at the beginning of an agent step.

        Only the velocities of those are read that have moved in the last one by the distance that
        a fast prop moves in a physics step, or whose velocity has been set.
        """
        if not self._small:
            return
        positions = self._scene.positions[self._rows]
        moved = np.abs(positions - self._positions).max(axis=1) > self._moved_m
        self._positions = positions
        self._fast = [
            prop
            for prop, has_moved in zip(self._small, moved.tolist(), strict=True)
            if (has_moved or prop.was_launched) and self._is_fast(prop)
        ]

    def _is_fast(self, prop: Prop) -> bool:
        prop.was_launched = False
        speed_mps = float(np.linalg.norm(prop.velocity))
        return speed_mps * self._substep_s > _FAST * prop.half_size_m

    def before_substep(self) -> None:
        """Move props that would meet something in the next physics step to where they meet it."""
        for prop in self._fast:
            if prop.holder is None:
                self._advance(prop, prop.half_size_m)

    def _advance(self, prop: Prop, half_m: float) -> None:
        velocity, spin = self._client.getBaseVelocity(prop.body_id)
        way = np.array(velocity) * self._substep_s
        length_m = float(np.linalg.norm(way))
        if not half_m < length_m < math.inf:  # a broken simulation is noticed after the step
            return
        position, orientation = self._client.getBasePositionAndOrientation(prop.body_id)
        start = np.array(position)
        free_m = free_path_m(self._client, start, start + way, half_m, prop.body_id) + _DEPTH_M
        if _DEPTH_M < free_m < length_m:
            place = (start + free_m / length_m * way).tolist()
            self._client.resetBasePositionAndOrientation(prop.body_id, place, orientation)
            self._client.resetBaseVelocity(prop.body_id, velocity, spin)


_ERP = 0.2  # Bullet's `contactERP`
# props with less cannot gain speed; what they have too much is a fraction of 0.2 at most
_LEAST_RESTITUTION = 1.0 - _ERP
_ROUNDS = 4  # over the contacts of two bodies, which influence each other
_SLOWEST_MPS = 0.2  # Bullet's `restitutionVelocityThreshold`: what is slower does not rebound


class _State(NamedTuple):
    """Position, rotation and velocities of a body: metres, ``(3, 3)``, m/s, rad/s."""

    centre: Floats
    rotation: Floats
    velocity: Floats
    spin: Floats


class Rebounds:
    """The loose props of one world that rebound nearly as fast as they arrive.

    Args:
        client: The PyBullet client.
        substep_s: Duration of a physics step.
    """

    def __init__(self, client: BulletClient, substep_s: float) -> None:
        self._client, self._substep_s = client, substep_s
        self._bouncing: list[Prop] = []
        self._loose: set[int] = set()
        self._before: dict[int, _State] = {}

    def add(self, prop: Prop) -> None:
        """Add a prop."""
        if prop.fixed or prop.joint is not None:
            return
        self._loose.add(prop.body_id)
        if prop.cfg.restitution > _LEAST_RESTITUTION:
            self._bouncing.append(prop)

    def before_substep(self) -> None:
        """Note how everything loose moves before a physics step of Bullet."""
        if self._bouncing:
            self._before = {body_id: self._state(body_id) for body_id in sorted(self._loose)}

    def after_substep(self) -> None:
        """Slow the props that have rebounded too fast in the physics step."""
        done: set[tuple[int, int]] = set()
        for prop in self._bouncing:
            if prop.holder is not None:
                continue
            points = self._client.getContactPoints(prop.body_id)
            for other_id in sorted({point.body_b for point in points}):
                pair = (min(prop.body_id, other_id), max(prop.body_id, other_id))
                if other_id != prop.body_id and pair not in done:
                    done.add(pair)
                    self._slow(prop, [point for point in points if point.body_b == other_id])

    def _is_rigid(self, point: ContactPoint) -> bool:
        """Return whether the other thing is loose or fixed: no door, drawer or joint-level body."""
        if point.body_b in self._loose:
            return True
        return point.link_b == -1 and self._client.getDynamicsInfo(point.body_b, -1).mass_kg == 0.0

    def _slow(self, prop: Prop, points: Sequence[ContactPoint]) -> None:
        """Reduce the speed with which a prop leaves another thing to what it may be."""
        pressed = [p for p in points if p.normal_force_n > 0.0 and self._is_rigid(p)]
        arrived_mps = [-self._parting_mps(self._before, point) for point in pressed]
        if max(arrived_mps, default=0.0) <= _SLOWEST_MPS:
            return
        other = self._client.getDynamicsInfo(pressed[0].body_b, pressed[0].link_b)
        restitution = prop.cfg.restitution * other.restitution
        if restitution <= _LEAST_RESTITUTION:
            return
        for _ in range(_ROUNDS if len(pressed) > 1 else 1):
            for point, speed_mps in zip(pressed, arrived_mps, strict=True):
                now = {body: self._state(body) for body in (point.body_a, point.body_b)}
                excess_mps = self._parting_mps(now, point) - restitution * max(speed_mps, 0.0)
                if excess_mps > 0.0:
                    self._push(now, point, -excess_mps)

    def _lever(self, body_id: int, point: ContactPoint) -> Floats:
        """Return the vector ``(3,)`` from a centre of mass to a contact, when Bullet found it."""
        lever: Floats = np.array(point.position_on_b)
        return lever - self._before[body_id].centre if body_id in self._before else lever

    def _parting_mps(self, states: dict[int, _State], point: ContactPoint) -> float:
        """Return the speed with which a prop and another thing part at a contact."""
        velocities = []
        for body_id in (point.body_a, point.body_b):
            state = states.get(body_id) or self._state(body_id)
            velocities.append(state.velocity + np.cross(state.spin, self._lever(body_id, point)))
        return float((velocities[0] - velocities[1]) @ np.array(point.normal_on_b))

    def _push(self, now: dict[int, _State], point: ContactPoint, change_mps: float) -> None:
        """Change the speed of parting at a contact by an impulse and its reaction."""
        along = np.array(point.normal_on_b)
        bodies = [(point.body_a, 1.0)]
        if point.body_b in self._loose:
            bodies.append((point.body_b, -1.0))
        levers = [self._lever(body_id, point) for body_id, _ in bodies]
        answers = [
            self._answer(body_id, lever, along)
            for (body_id, _), lever in zip(bodies, levers, strict=True)
        ]
        mobility = sum(
            float(along @ (velocity + np.cross(spin, lever)))
            for lever, (velocity, spin) in zip(levers, answers, strict=True)
        )
        impulse = change_mps / mobility
        for (body_id, sign), (velocity, spin) in zip(bodies, answers, strict=True):
            self._change(body_id, now[body_id], sign * impulse * velocity, sign * impulse * spin)

    def _change(self, body_id: int, state: _State, velocity: Floats, spin: Floats) -> None:
        """Change the velocities of a body, and what they have moved it in the physics step."""
        _, orientation = self._client.getBasePositionAndOrientation(body_id)
        centre = state.centre + velocity * self._substep_s
        self._client.resetBasePositionAndOrientation(body_id, centre.tolist(), orientation)
        velocities = (state.velocity + velocity).tolist(), (state.spin + spin).tolist()
        self._client.resetBaseVelocity(body_id, *velocities)

    def _answer(self, body_id: int, lever: Floats, along: Floats) -> tuple[Floats, Floats]:
        """Return the change of velocity and spin of a body by an impulse of 1 N s."""
        info, rotation = self._client.getDynamicsInfo(body_id, -1), self._before[body_id].rotation
        torque = rotation.T @ np.cross(lever, along)
        return along / info.mass_kg, rotation @ (torque / np.array(info.moments))

    def _state(self, body_id: int) -> _State:
        centre, orientation = self._client.getBasePositionAndOrientation(body_id)
        velocity, spin = self._client.getBaseVelocity(body_id)
        rotation = np.empty((1, 3, 3))
        quaternions_to_matrices(np.array([orientation]), rotation)
        return _State(np.array(centre), rotation[0], np.array(velocity), np.array(spin))
