"""Measured impulse responses of one head."""

from __future__ import annotations

from dataclasses import dataclass

from veca_marl.sim.geometry import Floats


class SofaError(ValueError):
    """The file does not contain usable head-related impulse responses; the message says why."""


@dataclass(frozen=True)
class MeasuredHead:
    """Measured impulse responses of one head.

    Attributes:
        impulse_responses: ``(M, 2, N)``, left ear first.
        directions: ``(M, 3)`` unit vectors to the loudspeaker in the head frame.
        delays_s: ``(M, 2)`` seconds of delay before the first sample of each response.
        sample_rate_hz: Sampling rate.
        distance_m: Distance of the loudspeaker from the centre of the head.
        source: Name of the file, for messages.
    """

    impulse_responses: Floats
    directions: Floats
    delays_s: Floats
    sample_rate_hz: float
    distance_m: float
    source: str
