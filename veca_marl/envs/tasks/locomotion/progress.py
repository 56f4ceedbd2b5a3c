"""Forward speed of a body that cannot be earned by moving to and fro."""

from __future__ import annotations

from veca_marl.envs.core.scoring import horizontal
from veca_marl.sim.geometry import Floats


class ForwardProgress:
    """Mean forward speed of a part of a body during a step, from its displacement.

    The speed is the smaller one of two: along the direction that the body faces now, and along the
    direction that it faced at the start of the episode. The sum over a motion that returns to where
    it began is therefore at most 0, however the body turns, tilts and times it.

    Args:
        step_s: Duration of an environment step.
        top_mps: Upper limit of the speed. There is no lower limit, since a fast motion backwards
            would cost less than the slow one forwards brought.
    """

    def __init__(self, step_s: float, top_mps: float) -> None:
        self._step_s, self._top_mps = step_s, top_mps

    def reset(self, position: Floats, forward: Floats) -> None:
        """Begin an episode at a position ``(3,)`` m, facing a horizontal unit vector ``(3,)``."""
        self._position, self._start_forward = position, forward
        self.speed_mps = 0.0

    def update(self, position: Floats, forward: Floats) -> None:
        """Set `speed_mps` after a step.

        Args:
            position: ``(3,)`` metres.
            forward: ``(3,)``, the direction that the body faces; its vertical part is ignored, and
                a vector with a horizontal part shorter than 1 scales the speed.
        """
        displacement, self._position = horizontal(position - self._position), position
        along = min(float(displacement @ self._start_forward), float(displacement @ forward))
        self.speed_mps = min(along / self._step_s, self._top_mps)
