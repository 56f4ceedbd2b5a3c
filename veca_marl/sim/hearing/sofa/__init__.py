"""Reader for head-related impulse responses in SOFA files (AES69). Needs ``veca_marl[sofa]``."""

from veca_marl.sim.hearing.sofa.measured_head import MeasuredHead, SofaError
from veca_marl.sim.hearing.sofa.reader import read_sofa

__all__ = ["MeasuredHead", "SofaError", "read_sofa"]
