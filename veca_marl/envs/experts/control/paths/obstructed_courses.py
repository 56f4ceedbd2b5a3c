"""Where furniture stops a walker on predicted courses."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from veca_marl.envs.tasks.floors.places import furniture_of
from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.envs.tasks.navigation.floors.floor_grid import CELL_M, floor_grid
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World

_MARGIN_M = 0.02  # for distances that are interpolated between the cells of a grid
_NEARER_M = 0.001  # per step, from which a course leads towards furniture and not along it
_FAR_M = 10.0  # distance to the furniture of a room that has none


class ObstructedCourses:
    """Holds courses of a walker where they meet furniture.

    What the walker can push does not stop it. Walls are not considered.

    Args:
        walker: The walker.
        world: Its world, with all props that stop it in their places for the episode.
    """

    def __init__(self, walker: Walker, world: World) -> None:
        grid = floor_grid(world.playground)
        heavy = [prop for prop in furniture_of(world) if not walker.is_light(prop)]
        self._first_m = grid.lower_m + CELL_M / 2.0
        self._away_m = np.full(grid.shape, _FAR_M)
        for prop in heavy:
            self._away_m = np.minimum(self._away_m, clearances_m(prop, grid.centres))
        self._clear_m = walker.radius_m + _MARGIN_M

    def held(self, start: Floats, courses: Floats) -> Floats:
        """Return courses that end where furniture is touched, and then stay there.

        A course touches furniture where it is too near and comes nearer: a walker that stands
        beside a piece can walk away from it, and along it.

        Args:
            start: Where all courses start, ``(2,)`` or ``(3,)`` metres.
            courses: Places after each step without obstacles, ``(plans, steps, 2)`` metres.

        Returns:
            ``(plans, steps, 2)`` metres.
        """
        plans, steps = courses.shape[:2]
        first = np.broadcast_to(start[:2], (plans, 1, 2))
        places = np.concatenate([first, courses], axis=1)
        away_m = self._distances_m(places)
        touches = (away_m[:, 1:] < self._clear_m) & (np.diff(away_m, axis=1) < -_NEARER_M)
        free_steps = np.where(touches.any(axis=1), touches.argmax(axis=1), steps)
        shown = np.minimum(np.arange(1, steps + 1), free_steps[:, None])
        held: Floats = np.take_along_axis(places, shown[..., None], axis=1)
        return held

    def _distances_m(self, places: Floats) -> Floats:
        """Return the distances from places ``(..., 2)`` to furniture, ``(...)`` metres."""
        cells = np.moveaxis((places - self._first_m) / CELL_M, -1, 0)
        distances: Floats = map_coordinates(self._away_m, cells, order=1, mode="nearest")
        return distances
