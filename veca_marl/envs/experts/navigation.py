"""Experts of ObjectNav, ObjectPhysNav and MazeNav: shortest paths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import WalkerLocomotion, locomotion_of
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.tasks.floors.grid_paths import Detour, PathsTo, floor_grid, free_cells, outside
from veca_marl.envs.tasks.navigation.maze_nav import MazeNav
from veca_marl.envs.tasks.navigation.object_nav import ObjectNav

_MARGIN_M = 0.15  # at least, from the distance at which a wrong object is reached


@register_expert("ObjectNav")
class ObjectNavExpert(Expert[ObjectNav]):
    """Takes the shortest path to the target that keeps away from wrong objects and furniture.

    Reads privileged state: its own position and heading, and the positions of all props.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        task, body = self.task, self.player.body
        locomotion = locomotion_of(self.player, task.world.clock.step_s)
        self._locomotion = WallRecovery(body, locomotion, task.world.clock.step_s)
        grid = floor_grid(task.world.playground)
        clear_m = locomotion.clearances.wall_m
        free = free_cells(grid, task.world, clear_m, passable=(task.target, *task.wrong))
        around_m = task.cfg.reach_m + max(_MARGIN_M, locomotion.clearances.turning_m)
        free &= outside(grid, [Detour(p.position, p.radius_m + around_m) for p in task.wrong])
        self._paths = PathsTo(grid, free, task.target.position)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        return self._locomotion.to(self._paths.next_point(self.player.body.position))

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()


@register_expert("ObjectPhysNav")
class ObjectPhysNavExpert(ObjectNavExpert):
    """Crawls on the shortest path to the target that keeps away from wrong objects and furniture.

    Reads privileged state: its own position, heading and joint angles, and the positions of all
    props. Where the gait gets stuck, the body crawls backwards.
    """


@register_expert("MazeNav")
class MazeNavExpert(Expert[MazeNav]):
    """Takes the shortest path to the object in every trial, the first one included.

    Reads privileged state: its own position and heading, the walls and the position of the object.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        task, walker = self.task, self.task.walker
        locomotion = WalkerLocomotion(walker)
        self._locomotion = WallRecovery(walker, locomotion, task.world.clock.step_s)
        grid = floor_grid(task.world.playground)
        clear_m = locomotion.clearances.wall_m
        free = free_cells(grid, task.world, clear_m, passable=(task.target,))
        self._paths = PathsTo(grid, free, task.target.position)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for a walker, see `Expert.act`."""
        return self._locomotion.to(self._paths.next_point(self.player.body.position))
