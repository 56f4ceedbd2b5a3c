"""The motion of a walker over floor and props, and the sound of its steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from veca_marl.sim.body.base import Body
from veca_marl.sim.body.walker.capsule import DISPLACED_M, Capsule
from veca_marl.sim.body.walker.feet import Footing, is_walked_over, middle, surface_height_m
from veca_marl.sim.body.walker.stances import Stance
from veca_marl.sim.body.walker.walker_cfg import WalkerCfg
from veca_marl.sim.body.walker.walker_collisions import WalkerCollisions
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.sound.modal_synthesis import (
    MATERIALS,
    Material,
    StruckBody,
    acceleration_noise,
    bar_modes,
)

_APPROACH_MPS = 3.0  # obstacles that approach faster may be overlooked within an agent step


class GroundMotion:
    """Moves the capsule of one walker at commanded speeds and keeps it out of obstacles.

    Args:
        world: The world.
        cfg: Parameters of the walker.
        upright: The stance in which an episode starts.
        on_all_fours: The stance of crawling; None for a walker that does not crawl.

    Attributes:
        stance: The stance at present; its capsule is the one that collides.
        footing: What the walker stands on.
        ground: ``(2,)`` metres, position on the floor plan.
        yaw_rad: Heading.
        velocity: ``(3,)`` m/s, mean over the last agent step, after contacts.
        speed_mps: Commanded speed, forward.
        turn_radps: Commanded turning speed, left is positive.
    """

    def __init__(
        self, world: World, cfg: WalkerCfg, upright: Stance, on_all_fours: Stance | None
    ) -> None:
        self._world, self._cfg = world, cfg
        self._upright, self._on_all_fours = upright, on_all_fours
        self.stance = upright
        self.footing = Footing(world.client)
        self.ground: Floats = np.zeros(2)
        self.velocity: Floats = np.zeros(3)
        self.yaw_rad = self.speed_mps = self.turn_radps = 0.0
        self._arrival: tuple[float, float, float] | None = None
        self._known = 0
        self._without_joint: dict[int, Prop] = {}

    @property
    def capsule(self) -> Capsule:
        """The capsule of the present stance."""
        return self.stance.capsule

    @property
    def capsule_ids(self) -> list[int]:
        """PyBullet's ids of the capsules of all stances."""
        stances = [self._upright, self._on_all_fours]
        return [stance.capsule.body_id for stance in stances if stance is not None]

    @property
    def can_crawl(self) -> bool:
        """Whether the walker has the stance of crawling."""
        return self._on_all_fours is not None

    @property
    def crawls(self) -> bool:
        """Whether the walker is on hands and knees."""
        return self.stance is self._on_all_fours

    def start(self, x: float, y: float, yaw_rad: float) -> None:
        """Stand upright, at rest, at the position on the floor nearest to ``(x, y)`` that is free.

        Args:
            x: Metres.
            y: Metres.
            yaw_rad: Heading.
        """
        self.ground, self.velocity, self._arrival = np.array([x, y]), np.zeros(3), None
        self.yaw_rad = yaw_rad
        self.speed_mps = self.turn_radps = 0.0
        self._stand_on_floor()
        self._collect_obstacles(0.0)
        self.ground[:] = self.capsule.resolve_contacts(self.ground[0], self.ground[1])
        self.capsule.set_velocity(0.0, 0.0, 0.0)
        self._step_start = self.ground.copy()

    def before_step(self) -> None:
        """Collect the obstacles that can be reached within this agent step."""
        self._step_start = self.ground.copy()
        step_s = self._world.clock.step_s
        self.capsule.leave_out(())
        self._collect_obstacles(abs(self.speed_mps) * step_s, _APPROACH_MPS * step_s)
        if self._cfg.stride_height_m > 0.0 and self.footing.prop is None:
            self._walk_over_low_things()

    @property
    def is_clear(self) -> bool:
        """Whether it walks on the floor, where only other walkers can be met in this agent step."""
        return self.capsule.is_clear and self.footing.prop is None and not self.footing.low

    @property
    def swept_circle(self) -> tuple[float, float, float]:
        """What its capsule can touch in this agent step: centre and radius, metres."""
        x, y = self.ground.tolist()
        way_m = abs(self.speed_mps) * self._world.clock.step_s
        return x, y, self.capsule.reach_m + DISPLACED_M + way_m

    def walk_freely(self) -> None:
        """Walk for an agent step in which nothing can be met; it ends with `after_step`.

        Meanwhile Bullet moves the capsule along the chord, in case something is very fast.
        """
        clock = self._world.clock
        start_yaw_rad, (x, y) = self.yaw_rad, self.ground.tolist()
        for _ in range(clock.substeps):
            x, y = self._along_arc(x, y, clock.substep_s)
        self._arrival = x, y, self.yaw_rad
        self.yaw_rad = start_yaw_rad
        vx, vy = ((x, y) - self.ground) / clock.step_s
        self.capsule.set_velocity(float(vx), float(vy), self.turn_radps)

    def _arrive(self, x: float, y: float, yaw_rad: float) -> None:
        """Stand at the end of the way of an agent step."""
        self.ground[:], self.yaw_rad = (x, y), yaw_rad
        self.stance.turn(yaw_rad)
        self.capsule.move_to(x, y)
        self._arrival = None

    def _walk_over_low_things(self) -> None:
        """Take what is low from the obstacles; the walker stands on it where it is."""
        props = self._world.props.values()
        if len(props) != self._known:
            self._known = len(props)
            self._without_joint = {prop.body_id: prop for prop in props if prop.joint is None}
        found = (self._without_joint.get(body_id) for body_id in self.capsule.near)
        near = [prop for prop in found if prop is not None]
        base_m, before = self.footing.height_m, self.footing.low
        self.footing.low = [
            prop
            for prop in near
            if is_walked_over(
                self._world.client, prop, self.ground, base_m, self._cfg, self.yaw_rad
            )
        ]
        self.capsule.leave_out([prop.body_id for prop in self.footing.low])
        if before and not self.footing.low:
            self._update_surface()

    def proposed_position(self, substep_s: float) -> tuple[float, float]:
        """Turn; return the position after this physics step without obstacles, metres.

        It is the end of the arc of a circle that constant speeds give, for any duration.
        """
        here_x, here_y = self.ground.tolist()
        x, y = self._along_arc(here_x, here_y, substep_s)
        self.stance.turn(self.yaw_rad)
        return x, y

    def _along_arc(self, x: float, y: float, duration_s: float) -> tuple[float, float]:
        """Turn; return the end of the way from a position without obstacles, metres."""
        half_rad = self.turn_radps * duration_s / 2.0
        chord_share = math.sin(half_rad) / half_rad if half_rad else 1.0
        chord_m = self.speed_mps * duration_s * chord_share
        x += chord_m * math.cos(self.yaw_rad + half_rad)
        y += chord_m * math.sin(self.yaw_rad + half_rad)
        self.yaw_rad += 2.0 * half_rad
        return x, y

    def resolve_contacts(self, x: float, y: float) -> tuple[float, float]:
        """Return the position nearest to ``(x, y)``, on its side of walls, outside obstacles."""
        last_x, last_y = self.ground.tolist()
        return self.capsule.resolve_contacts(x, y, (last_x, last_y))

    def set_position(self, x: float, y: float, substep_s: float) -> None:
        """Set the position at the end of a physics step."""
        vx, vy = (x - self.ground[0]) / substep_s, (y - self.ground[1]) / substep_s
        self.ground[:] = x, y
        self.capsule.set_velocity(vx, vy, self.turn_radps)
        if self.footing.prop is not None or self.footing.low:
            self._update_surface()

    def after_step(self) -> None:
        """End the agent step: arrive, and compute the mean velocity over it."""
        if self._arrival is not None:
            self._arrive(*self._arrival)
        self.velocity[:2] = (self.ground - self._step_start) / self._world.clock.step_s

    def can_step_on(self, prop: Prop) -> bool:
        """Return whether there is room for it on the middle of a prop."""
        top_m = surface_height_m(self._world.client, prop, *middle(prop))
        if top_m is None:
            return False
        here, base_m, support_id = self.ground.copy(), self.capsule.base_m, self.capsule.support_id
        self._stand_at(np.array(middle(prop)), top_m, prop.body_id)
        occupied = self.capsule.overlaps(*self.ground)
        self._stand_at(here, base_m, support_id)
        return not occupied

    def _stand_at(self, place: Floats, height_m: float, support_id: int) -> None:
        """Move the capsule to a place ``(2,)`` on a surface of a height, on a prop or -1."""
        self.ground[:], self.capsule.base_m, self.capsule.support_id = place, height_m, support_id
        self._collect_obstacles(0.0)
        self.capsule.move_to(*self.ground)

    def step_on(self, prop: Prop) -> None:
        """Stand on the middle of a prop, which is no obstacle from now on."""
        self.footing.step_on(prop)
        self.ground[:] = middle(prop)
        self.capsule.support_id = prop.body_id
        self._update_surface()

    def crawl(self) -> bool:
        """Go down on hands and knees; return False, without effect, where there is no room."""
        return self._on_all_fours is not None and self._change_stance(self._on_all_fours)

    def stand_up(self) -> bool:
        """Stand upright; return False, without effect, where there is no room."""
        return self._change_stance(self._upright)

    def _change_stance(self, stance: Stance) -> bool:
        """Change the stance if its capsule is free of obstacles; return whether it is."""
        before, self.stance = self.stance, stance
        self._collect_obstacles(0.0)
        stance.turn(self.yaw_rad)
        if self.capsule.overlaps(*self.ground):
            self.capsule.park()
            self.stance = before
            return False
        before.capsule.park()
        return True

    def _stand_on_floor(self) -> None:
        """Stand upright on the floor."""
        self.footing.leave()
        if self._on_all_fours is not None:
            # disabling contacts with new obstacles within an episode would alter other contacts
            self.stance = self._on_all_fours
            self._collect_obstacles(0.0)
            self.capsule.park()
        self.stance = self._upright
        self.capsule.base_m, self.capsule.support_id = 0.0, -1
        self.capsule.leave_out(())

    def _update_surface(self) -> None:
        """Set the height of the capsule to that of the surface under it."""
        self.footing.follow(*self.ground)
        self.capsule.base_m = self.footing.height_m
        if self.footing.prop is None:
            self.capsule.support_id = -1

    def _collect_obstacles(self, distance_m: float, approach_m: float = 0.0) -> None:
        """Collect the obstacles within a distance, joint-level bodies and walkers among them.

        Args:
            distance_m: That the walker covers.
            approach_m: By which things that move come nearer.
        """
        movers = self._world.movers
        bodies = [id_ for mover in movers if isinstance(mover, Body) for id_ in mover.obstacle_ids]
        collisions = (mover for mover in movers if isinstance(mover, WalkerCollisions))
        capsules = [id_ for each in collisions for id_ in each.capsule_ids]
        self.capsule.collect_obstacles(
            self._world.props, bodies, capsules, self.ground, distance_m, approach_m
        )


_FOOT_MASS_SHARE = 0.06
"""Effective mass of a foot that lands, as a share of the body's, 6.3 % in walking, 5.3 % in running
(Chi & Schmitt 2005, Mechanical energy and effective foot mass during impact loading)."""

_FLOOR = replace(MATERIALS[Material.wood], loss_tangent=0.1)
"""Boards that lie on joists lose more than free ones; the value is ours."""

_BOARD_M = (0.6, 0.02)  # length and thickness of a floorboard, which the foot excites
_SOLE_M = 0.03  # radius of a sphere with the volume of a child's forefoot


class Footsteps:
    """Strikes a floorboard under a walker whenever one of its feet lands."""

    def __init__(self, name: str, mass_kg: float, world: World) -> None:
        """Add the source of sound of a walker.

        Args:
            name: Of the walker.
            mass_kg: Of the walker.
            world: Its world; nothing is added unless it has sounds of impacts.
        """
        impacts = world.playground.impacts
        self._foot_kg = _FOOT_MASS_SHARE * mass_kg
        self._min_speed_mps = impacts.min_speed_mps
        self._board: StruckBody | None = None
        self._rate_hz, self._last_sample = world.sound.sample_rate_hz, world.sound.step_samples - 1
        if impacts.present:
            sole = MATERIALS[Material.rubber]
            length, thickness = _BOARD_M
            modes = bar_modes(length, thickness / 12.0**0.5, _FLOOR)
            click = acceleration_noise(_SOLE_M, sole.contact_s)
            self._board = StruckBody(modes + click, impacts.gain_per_ns, self._rate_hz)
            self._source = world.sound.add_source(f"{name}.steps", self._board)

    def teleport(self, surface: Floats) -> None:
        """Sound at another place from now on, without motion; see `follow`."""
        if self._board is not None:
            self._source.teleport(_sole(surface))

    def follow(
        self, surface: Floats, landing_speed_mps: float, landings_s: Sequence[float]
    ) -> None:
        """Sound at a place on the floor whenever a foot landed in this agent step.

        Args:
            surface: ``(3,)`` metres, on the floor or prop beneath the walker.
            landing_speed_mps: Speed at which feet land.
            landings_s: When they did, seconds from the beginning of the step.
        """
        if self._board is None:
            return
        self._source.position = _sole(surface)
        if landing_speed_mps > self._min_speed_mps:
            for landing_s in landings_s:
                sample = min(int(landing_s * self._rate_hz), self._last_sample)
                self._board.strike(self._foot_kg * landing_speed_mps, sample)


def _sole(surface: Floats) -> Floats:
    """Return the middle ``(3,)`` of a sole on a surface, metres."""
    place: Floats = surface + np.array([0.0, 0.0, _SOLE_M])
    return place
