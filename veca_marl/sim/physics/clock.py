"""The clock of a world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from veca_marl.sim.sound import SAMPLE_RATE_HZ

CONTROL_RATES_HZ = tuple(
    rate for rate in range(1, SAMPLE_RATE_HZ + 1) if SAMPLE_RATE_HZ % rate == 0
)
"""Possible numbers of agent steps per second, the divisors of the sampling rate."""

_MOST_SUBSTEPS = 1000  # of 0.04 ms at 25 Hz; those of four joint-level bodies take seconds
_MOST_ITERATIONS = 10_000  # more would take minutes
_LONGEST_S = 1e6  # seconds; they are counted in physics steps


@dataclass
class ClockCfg:
    """The constant clock: physics, sound and animation advance by it, wall time has no influence.

    The paper's VECATime. An agent step emits a whole number of samples of sound, so that blocks of
    sound follow each other without gaps: its rate divides 22 050 Hz (`CONTROL_RATES_HZ`). The rate
    of physics is any multiple of it: 25 Hz times 10 are the 250 Hz (4 ms) of the paper's data,
    although 250 Hz is no possible rate of agent steps; the nearest is 245 Hz (4.08 ms). The default
    of 5 physics steps per agent step has steps of 8 ms.

    Attributes:
        control_rate_hz: Agent steps per second; one of `CONTROL_RATES_HZ`.
        substeps: Physics steps per agent step, 1 to 1000.
        solver_iterations: Iterations of Bullet's constraint solver per physics step; at least 20
            in worlds with a body that holds target angles with moving fingers; at most 10 000.
        contact_share: Distance at which Bullet detects contacts ahead of time, as a fraction of the
            size of the smaller of two objects, in (0, 1]. What moves further in one physics step
            penetrates before its contact is found; 0.1 finds those of a palm-sized object 5 mm
            ahead, at twice the cost of physics. Contacts of movable props with restitution are
            detected proportionally less far ahead at physics steps below 8 ms.
        sleep_s: Seconds after which props at rest sleep: Bullet does not simulate them until
            something comes near. 0.4 as in PhysX; at most 1e6; infinite: never. What moves by less
            than 1 cm/s and 0.01 rad/s counts as at rest. Worth it where many things lie about and
            bodies walk.
    """

    control_rate_hz: int = 25
    substeps: int = 5
    solver_iterations: int = 10
    contact_share: float = 0.02
    sleep_s: float = math.inf

    def __post_init__(self) -> None:
        """Check the rate and the numbers."""
        if self.control_rate_hz not in CONTROL_RATES_HZ:
            raise ValueError(_rate_error(self.control_rate_hz))
        for name, most in (("substeps", _MOST_SUBSTEPS), ("solver_iterations", _MOST_ITERATIONS)):
            if not 1 <= getattr(self, name) <= most:
                raise ValueError(f"{name}={getattr(self, name)} must be from 1 to {most}")
        if not (0.0 < self.sleep_s <= _LONGEST_S or self.sleep_s == math.inf):
            raise ValueError(
                f"sleep_s={self.sleep_s} must be above 0 and at most {_LONGEST_S:g}; "
                "inf: nothing sleeps"
            )
        if not 0.0 < self.contact_share <= 1.0:
            raise ValueError(f"contact_share={self.contact_share} must be above 0 and at most 1")

    @cached_property  # read many times in each step
    def step_s(self) -> float:
        """Duration of an agent step."""
        return 1.0 / self.control_rate_hz

    @cached_property
    def substep_s(self) -> float:
        """Duration of a physics step."""
        return self.step_s / self.substeps

    @cached_property
    def step_samples(self) -> int:
        """Samples of sound per agent step."""
        return SAMPLE_RATE_HZ // self.control_rate_hz


def _rate_error(rate_hz: float) -> str:
    """Return the message for an impossible rate of agent steps, with the nearest possible ones."""
    below = [rate for rate in CONTROL_RATES_HZ if rate < rate_hz][-1:]
    above = [rate for rate in CONTROL_RATES_HZ if rate > rate_hz][:1]
    nearest = " and ".join(str(rate) for rate in below + above)
    return (
        f"control_rate_hz={rate_hz}: an agent step must hold a whole number of samples of sound, "
        f"that is divide {SAMPLE_RATE_HZ} Hz; the nearest that do: {nearest}. For shorter physics "
        "steps at a possible rate raise substeps"
    )
