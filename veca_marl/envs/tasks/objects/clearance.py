"""Clearance of boxes above the floor."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.physics import Prop


def clearance_m(box: Prop) -> float:
    """Return the height of the lowest corner of a box above the floor at z = 0, metres.

    A box that is tipped on the floor has no clearance, although its centre rises.
    """
    half_height = 0.5 * float(np.abs(box.rotation[2]) @ np.asarray(box.cfg.size_m))
    return float(box.position[2]) - half_height
