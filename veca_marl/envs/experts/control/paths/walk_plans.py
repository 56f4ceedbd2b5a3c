"""A few courses that a walker can take in the next seconds, and where they lead."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import Floats

_TURNS_S = (0.25, 0.5, 0.75, 1.0, 1.5)  # durations of the first phase, in which it turns


class WalkPlans(NamedTuple):
    """Candidate courses: turn for a while, on the spot or walking, then go straight.

    Attributes:
        commands: ``(plans, steps, 2)``: (forward, turn) in [-1, 1] for each step.
        step_s: Duration of a step.
    """

    commands: Floats
    step_s: float

    def positions(self, start: Floats, yaw_rad: float, cfg: WalkerCfg) -> Floats:
        """Return the positions after each step, without obstacles.

        Args:
            start: ``(2,)`` or ``(3,)`` metres.
            yaw_rad: Heading at the start.
            cfg: The speeds of the walker.

        Returns:
            ``(plans, steps, 2)`` metres.
        """
        forward = self.commands[..., 0]
        speed = cfg.walk_speed_mps * np.where(forward < 0.0, cfg.backward_share, 1.0) * forward
        yaw = self.headings(yaw_rad, cfg)
        moves = speed[..., None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1) * self.step_s
        positions: Floats = np.asarray(start)[:2] + np.cumsum(moves, axis=1)
        return positions

    def headings(self, yaw_rad: float, cfg: WalkerCfg) -> Floats:
        """Return the headings after each step, ``(plans, steps)`` rad; arguments as above."""
        turned = np.cumsum(self.commands[..., 1], axis=1) * np.radians(cfg.turn_speed_degps)
        headings: Floats = yaw_rad + turned * self.step_s
        return headings


def walk_plans(horizon_s: float, step_s: float) -> WalkPlans:
    """Return all courses of one duration: straight ahead, straight back, stand, and with turns."""
    steps = round(horizon_s / step_s)
    plans = [_plan(steps, 0, (0.0, 0.0), forward) for forward in (1.0, -1.0, 0.0)]
    for turn_s in _TURNS_S:
        count = min(steps, round(turn_s / step_s))
        for turn in (1.0, -1.0):
            plans += [_plan(steps, count, (forward, turn), 1.0) for forward in (0.0, 1.0)]
    return WalkPlans(np.array(plans), step_s)


def _plan(steps: int, count: int, first: tuple[float, float], forward: float) -> Floats:
    """Return the commands ``(steps, 2)`` of a first phase, and of walking straight after it."""
    commands = np.zeros((steps, 2))
    commands[:count] = first
    commands[count:, 0] = forward
    return commands
