"""The observation `trial`: that a trial has ended, how long it lasts, and how many are over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.physics import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.senses import register_sense
from veca_marl.sim.spec import ArraySpec

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
        trial: ``(3,)`` float32 in [0, 1]: 1 in the last observation of a trial, else 0; the share
            of the trial's time that has passed; the share of the episode's trials that are over.
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
