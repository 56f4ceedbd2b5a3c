"""Touch: taxels, the penetration model and the sense of touch."""

from veca_marl.sim.touch.quality import TouchQuality
from veca_marl.sim.touch.sense import TouchCfg, TouchSense
from veca_marl.sim.touch.taxels import TAXELS_PER_TRIANGLE, load_taxels, taxel_positions, taxels_of

__all__ = [
    "TAXELS_PER_TRIANGLE",
    "TouchCfg",
    "TouchQuality",
    "TouchSense",
    "load_taxels",
    "taxel_positions",
    "taxels_of",
]
