"""Low-pass filter of the twist of the trunk, for inverse kinematics of the arms."""

from __future__ import annotations

from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.geometry import Floats

_TRUNK = ("spine", "chest")
_TWIST = ("lateral", "rotation")
_SHARE_PER_S = 3.75  # of the difference: a time constant of 0.27 s


class TrunkTwist:
    """Joint angles of a body with filtered lateral flexion and rotation of its trunk.

    Arms that follow the twist of the trunk without a filter accelerate against it with a delay of
    one agent step. Their reaction amplifies the twist: trunk and palms oscillate at 2.4 Hz, the
    palms by 20 mm to either side. With the filter the amplitude is 2 mm.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._share = body, min(1.0, _SHARE_PER_S * step_s)
        names = body.joint_names
        self._joints = [names.index(f"{bone}.{twist}") for bone in _TRUNK for twist in _TWIST]
        self.reset()

    def reset(self) -> None:
        """Start from the present joint angles."""
        self._filtered = self._body.joint_angles()[self._joints]

    def filtered_angles(self) -> Floats:
        """Return joint angles ``(82,)`` rad, those of the twist filtered. One call per step."""
        angles = self._body.joint_angles()
        self._filtered = self._filtered + self._share * (angles[self._joints] - self._filtered)
        angles[self._joints] = self._filtered
        return angles
