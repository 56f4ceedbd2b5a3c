"""Expert of MazeNav: the shortest path in every trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import WalkerLocomotion
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.tasks.floors.grid_paths import PathsTo
from veca_marl.envs.tasks.navigation.floors.floor_grid import floor_grid, free_cells
from veca_marl.envs.tasks.navigation.maze_nav import MazeNav


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
