"""The clock of a world."""

from __future__ import annotations

from dataclasses import dataclass

from veca_marl.sim.sound import SAMPLE_RATE_HZ

_CONTACT_STEP_S = 0.008  # physics step at which `contact_share` is the detection distance


@dataclass
class ClockCfg:
    """The constant clock: physics, sound and animation advance by it, wall time has no influence.

    The paper's VECATime. 25 Hz divides the sampling rate of sound (22 050 Hz) evenly.

    Attributes:
        control_rate_hz: Agent steps per second; must divide 22 050.
        substeps: Physics steps per agent step.
        solver_iterations: Iterations of Bullet's constraint solver per physics step.
        contact_share: Distance at which Bullet detects contacts ahead of time, as a share of the
            size of the smaller of two objects, in (0, 1], at physics steps of 8 ms; in proportion
            less at shorter steps, in which objects move less. What moves further in one physics
            step penetrates before its contact is found; 0.1 finds those of a palm-sized object 5 mm
            ahead, at twice the cost of physics.
    """

    control_rate_hz: int = 25
    substeps: int = 5
    solver_iterations: int = 10
    contact_share: float = 0.02

    def __post_init__(self) -> None:
        """Accept only rates at which an agent step is a whole number of samples."""
        if self.control_rate_hz <= 0 or SAMPLE_RATE_HZ % self.control_rate_hz:
            raise ValueError(
                f"control_rate_hz={self.control_rate_hz} must divide 22050: 10, 15, 18, 21, 25, 30"
            )
        if self.substeps < 1 or self.solver_iterations < 1:
            raise ValueError(
                f"substeps={self.substeps} and solver_iterations={self.solver_iterations} "
                "must be at least 1"
            )
        if not 0.0 < self.contact_share <= 1.0:
            raise ValueError(f"contact_share={self.contact_share} must be above 0 and at most 1")

    @property
    def step_s(self) -> float:
        """Duration of an agent step."""
        return 1.0 / self.control_rate_hz

    @property
    def substep_s(self) -> float:
        """Duration of a physics step."""
        return self.step_s / self.substeps

    @property
    def contact_threshold(self) -> float:
        """The distance at which Bullet detects contacts, as a share of size, at this time step.

        Bullet stops an object short of a contact ahead of it. At a constant distance it would take
        a greater part of the speed from it, the shorter the step.
        """
        return self.contact_share * min(1.0, self.substep_s / _CONTACT_STEP_S)

    @property
    def step_samples(self) -> int:
        """Samples of sound per agent step."""
        return SAMPLE_RATE_HZ // self.control_rate_hz
