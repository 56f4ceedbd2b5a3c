"""Touch: taxels, the penetration model and the sense of touch."""

from veca_marl.sim.touch.parts import Part, skin_parts
from veca_marl.sim.touch.quality import TouchQuality
from veca_marl.sim.touch.taxels import (
    TAXELS_PER_TRIANGLE,
    TaxelTable,
    load_taxels,
    taxel_positions,
    taxels_of,
)
from veca_marl.sim.touch.touch_sense import Tactile, TouchCfg, TouchSense, get_tactile

__all__ = [
    "TAXELS_PER_TRIANGLE",
    "Part",
    "Tactile",
    "TaxelTable",
    "TouchCfg",
    "TouchQuality",
    "TouchSense",
    "get_tactile",
    "load_taxels",
    "skin_parts",
    "taxel_positions",
    "taxels_of",
]
