"""Going to things and applying verbs to them, for walkers."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.locomotion import WalkerLocomotion, bearing_rad
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.tasks.floors.grid_paths import PathsTo, floor_grid, free_cells
from veca_marl.envs.tasks.floors.places import gap_m
from veca_marl.sim.body.walker import WalkCommand, Walker
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, World
from veca_marl.sim.physics.interactions import INTERACTIONS, NO_VERB

_STOP_M = 0.7  # from the surface of a thing: nearer ones can be below the view
_BACK_M = 0.5  # nearer things are below the view
_AHEAD_RAD = 0.4
_ARRIVED_M = 0.06
_MOVED_M = 0.1  # paths are computed again when their goal has moved so far


class Handling:
    """Walks to one thing after the other, and applies verbs to them.

    Paths lead round everything that is fixed. Light things are pushed out of the way.

    Args:
        walker: The body.
        world: Its world, with all fixed props in their places for the episode.
    """

    def __init__(self, walker: Walker, world: World) -> None:
        locomotion = WalkerLocomotion(walker)
        self._walker = walker
        self._locomotion = WallRecovery(walker, locomotion, world.clock.step_s)
        self._grid = floor_grid(world.playground)
        movable = [prop for prop in world.props.values() if walker.is_light(prop)]
        clear_m = locomotion.clearances.wall_m
        self._free = free_cells(self._grid, world, clear_m, passable=movable)
        self._place: Floats = np.zeros(2)
        self._paths: PathsTo | None = None

    def target(self, verb: str) -> Prop | None:
        """Return what a verb would be applied to at present."""
        return INTERACTIONS.find(verb)().target(self._walker)

    def apply(self, verb: str) -> WalkCommand:
        """Stand still and apply a verb."""
        return WalkCommand(0.0, 0.0, verb=verb)

    def approach(self, prop: Prop) -> WalkCommand:
        """Walk until a thing is in view and near, then turn to it."""
        here = self._walker.position
        bearing, away_m = bearing_rad(self._walker, prop.position), gap_m(here, prop)
        if away_m > _STOP_M:
            return self.walk_to(prop.position)
        if abs(bearing) > _AHEAD_RAD:
            return WalkCommand(0.0, math.copysign(1.0, bearing))
        return WalkCommand(-1.0 if away_m < _BACK_M else 0.4, bearing / _AHEAD_RAD)

    def stand_at(self, place: Floats, facing: Floats) -> WalkCommand:
        """Walk to a place, ``(2,)`` or ``(3,)`` metres, then turn to another one."""
        if horizontal_distance(self._walker.position, place) > _ARRIVED_M:
            return self.walk_to(place)
        bearing = bearing_rad(self._walker, facing)
        return WalkCommand(0.0, min(max(bearing / _AHEAD_RAD, -1.0), 1.0))

    def walk_to(self, place: Floats) -> WalkCommand:
        """Walk to a place, ``(2,)`` or ``(3,)`` metres."""
        point = self._paths_to(place[:2]).next_point(self._walker.position)
        forward, turn, _ = self._locomotion.to(point)
        return WalkCommand(forward, turn, verb=NO_VERB)

    def _paths_to(self, place: Floats) -> PathsTo:
        """Return the paths to a place, which are recomputed when it has moved."""
        if self._paths is None or math.dist(place, self._place) > _MOVED_M:
            self._place = place
            self._paths = PathsTo(self._grid, self._free, place)
        return self._paths
