"""MazeNav: find an object in a maze, and find it again faster."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.task import Player, Task, TaskCfg, register_task, require_walker, terms
from veca_marl.envs.tasks.floors.outlines import check_reach
from veca_marl.envs.tasks.floors.places import add_target, gap_m, planned_target
from veca_marl.envs.tasks.navigation.mazes import (
    Cell,
    Maze,
    MazeWalls,
    beyond_walls_m,
    check_maze,
    passage_m,
    random_maze,
)
from veca_marl.sim.body import Body, BodyCfg
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.body.walker.walker_cfg import sized
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg, World
from veca_marl.sim.sense import ArraySpec, Sense
from veca_marl.sim.senses import register_sense

TRIAL = "trial"


@dataclass
class TrialCfg:
    """Settings of the observation `trial`.

    Attributes:
        present: Whether the observation has it.
    """

    present: bool = True


@register_sense(TRIAL)
class TrialSense(Sense):
    """The progress of the trials of an episode, which the task reports by `show`.

    Observations:
        trial: ``(3,)`` float32 in [0, 1]: 1 in the last observation of a trial, else 0; the
            fraction of the trial's time that has passed; the fraction of the episode's trials that
            are over.
    """

    cfg_type = TrialCfg

    def __init__(self, cfg: TrialCfg, body: Body, world: World) -> None:
        super().__init__(world)
        names = ("ended", "elapsed", "completed")
        self.specs = {TRIAL: ArraySpec((3,), np.float32, 0.0, 1.0, names)}
        self._state = np.zeros(3, np.float32)

    def reset(self) -> None:
        """See `Sense.reset`."""
        super().reset()
        self._state[:] = 0.0

    def show(self, ended: bool, elapsed: float, completed: float) -> None:
        """Set the values of this step; called by the task after each step."""
        self._state[:] = ended, min(elapsed, 1.0), completed

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        return {TRIAL: self._state.copy()}


_RADIUS_M = 0.15  # of the object


@dataclass
class MazeNavCfg(TaskCfg):
    """Parameters of MazeNav. Of these only the number of trials is in the paper.

    Attributes:
        cells: Cells along each side of the maze, at least 2; a cell measures at least 0.7 m.
        trials: Trials in each maze. If `max_seconds` is less than ``trials * trial_s``, an episode
            with slow trials is truncated before the last one, and is not solved.
        trial_s: Time after which a trial ends without success, at least a step.
        reach_m: Horizontal distance from the pelvis to the surface of the object within which it
            has been reached; so small that it is not reached through a wall: below 0.36 m with
            cells of 0.7 m, below 0.76 m with the default ones.
    """

    max_seconds: float = 150.0
    cells: int = 4
    trials: int = 5
    trial_s: float = 30.0
    reach_m: float = 0.3
    weights: dict[str, float] = terms(reached=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("trial_s", "reach_m")
        if self.trials < 1:
            raise ValueError(f"task.trials={self.trials} must be at least 1")


@register_task
class MazeNav(Task):
    """An agent has to find an object in a maze, several times in the same maze.

    Each episode has a new random maze. Its walls, the position of the object and the start stay the
    same for `trials` trials, so that an agent with a memory can walk straight to the object after
    the first trial. A trial ends when the object is reached or after `trial_s`; then the next one
    begins at the start, with a heading drawn anew. The action of the step in which the agent is
    returned to the start has no effect. The episode terminates after the last trial; the task is
    solved (`solved`) if all trials have ended at the object.

    The observation `trial` reports the end of a trial, see `TrialSense`;
    `+senses.extra.trial.present=false` removes it. The task is that of RL^2 (Duan et al. 2016) with
    five trials in each maze, as the paper states (table of tasks in the appendix). Not in the
    paper: the size of the maze, the times, the observation `trial`, and that the start is the same
    in all trials. A maze has one path between any two cells; the path from the start to the object
    has at least ``cells - 1`` steps.

    Terms:
        reached: 1 on the step in which the object is reached, else 0.
    """

    senses = ("vision", TRIAL)
    body_cfg = WalkerCfg
    cfg: MazeNavCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_maze(playground, cfg.cells)
        _check_reach(cfg, playground, WalkerCfg().radius_m)

    @classmethod
    def check_distances(
        cls, cfg: Any, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
    ) -> None:
        for body in bodies.values():
            if isinstance(body, WalkerCfg):
                _check_passage(cfg, playground, sized(body).radius_m)
        check_reach(cfg.reach_m, planned_target(_RADIUS_M), bodies)

    @classmethod
    def check_clock(cls, cfg: Any, clock: ClockCfg) -> None:
        if cfg.trial_s < clock.step_s:
            raise ValueError(
                f"task.trial_s={cfg.trial_s:g} is shorter than a step of {clock.step_s:g} s "
                f"(clock.control_rate_hz={clock.control_rate_hz:g}); choose at least a step, such "
                "as the default of 30 s"
            )

    def build(self) -> None:
        self.walker = require_walker(self.players[0])
        _check_passage(self.cfg, self.world.playground, self.walker.radius_m)
        _check_reach(self.cfg, self.world.playground, self.walker.radius_m)
        self._walls = MazeWalls(self.world, self.cfg.cells)
        self.target = add_target(self.world, _RADIUS_M)
        self._start: Cell = (0, 0)
        self._completed = self._found = 0
        self._elapsed_s = 0.0
        self._found_now = self._ended_now = False

    def reset(self, rng: np.random.Generator) -> None:
        maze = random_maze(self.cfg.cells, rng)
        self._walls.build(maze, rng)
        goal, self._start = _draw_goal_and_start(maze, rng)
        self.target.place(self._walls.middle_of(goal, _RADIUS_M))
        self._completed = self._found = 0
        self._begin_trial(rng)

    def before_step(self, rng: np.random.Generator) -> None:
        if self._ended_now:
            self._begin_trial(rng)

    def after_step(self, rng: np.random.Generator) -> None:
        self._elapsed_s += self.world.clock.step_s
        self._found_now = gap_m(self.walker.position, self.target) <= self.cfg.reach_m
        self._ended_now = self._found_now or self._elapsed_s >= self.cfg.trial_s - 1e-9
        self._found += self._found_now
        self._completed += self._ended_now
        self._show_trial()

    def reward(self, player: Player) -> dict[str, float]:
        return {"reached": float(self._found_now)}

    def terminated(self) -> bool:
        return self._completed == self.cfg.trials

    def solved(self, player: Player) -> bool:
        """Return whether all trials have ended at the object."""
        return self._found == self.cfg.trials

    def state(self) -> dict[str, float]:
        trials = self.cfg.trials
        return {"trial": self._completed / trials, "elapsed": self._elapsed_s / self.cfg.trial_s}

    def _begin_trial(self, rng: np.random.Generator) -> None:
        self.walker.place(self._walls.middle_of(self._start), rng.uniform(-math.pi, math.pi))
        self._elapsed_s = 0.0
        self._found_now = self._ended_now = False

    def _show_trial(self) -> None:
        sense = self.players[0].senses.get(TRIAL)
        if isinstance(sense, TrialSense):
            elapsed = self._elapsed_s / self.cfg.trial_s
            sense.show(self._ended_now, elapsed, self._completed / self.cfg.trials)


def _check_passage(cfg: MazeNavCfg, playground: PlaygroundCfg, body_m: float) -> None:
    """Check that a body of a radius fits between the walls.

    Raises:
        ValueError: If it does not.
    """
    width_m = passage_m(playground, cfg.cells)
    if 2.0 * body_m >= width_m:
        raise ValueError(
            f"body.radius_m={body_m} does not fit through passages of {width_m:.4g} m with "
            f"task.cells={cfg.cells} in playground {playground.name!r}; choose a smaller one, or "
            "fewer cells"
        )


def _check_reach(cfg: MazeNavCfg, playground: PlaygroundCfg, body_m: float) -> None:
    """Check that a body of a radius does not reach the object through a wall.

    Raises:
        ValueError: If it does.
    """
    limit_m = beyond_walls_m(playground, cfg.cells, body_m) - _RADIUS_M
    if cfg.reach_m >= limit_m:
        raise ValueError(
            f"task.reach_m={cfg.reach_m} must be below {limit_m:.4g} with task.cells={cfg.cells} "
            f"in playground {playground.name!r} and a body of radius {body_m} m: the object would "
            "be reached through a wall; choose a smaller one, or fewer cells"
        )


def _draw_goal_and_start(maze: Maze, rng: np.random.Generator) -> tuple[Cell, Cell]:
    """Draw the cell of the object, and a start that is at least ``size - 1`` cells away from it."""
    x, y = rng.integers(maze.size, size=2).tolist()
    steps = maze.steps_from((x, y))
    far = [cell for cell, count in steps.items() if count >= maze.size - 1]
    return (x, y), far[int(rng.integers(len(far)))]
