"""The share of random pokes of a fingertip that at least one taxel senses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.fidelity.touch.bare_body import BareBody
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.geometry import Shape
from veca_marl.sim.touch import TouchCfg

# the distal bone of an index finger with its skin, pressed end on
FINGERTIP = (Shape.CAPSULE, (0.0044, 0.004))
FINGERTIP_SKIN_M = 0.0015
NOTICED = 0.02
"""Readings above this count as sensed."""
REGIONS = {
    "head": ("head",),
    "trunk": ("pelvis", "spine", "chest"),
    "upper arm": ("l_upper_arm", "r_upper_arm"),
    "forearm": ("l_forearm", "r_forearm"),
    "hand": ("l_hand", "r_hand"),
    "thigh": ("l_thigh", "r_thigh"),
    "shank": ("l_shank", "r_shank"),
    "foot": ("l_foot", "r_foot"),
}
"""Bones of each region of the body that is poked."""


@dataclass(frozen=True)
class Noticed:
    """How many pokes were sensed.

    Attributes:
        share: Share of the pokes with a reading above `NOTICED`.
        strength: Mean of the largest reading of each poke.
    """

    share: float
    strength: float


def noticed_pokes(
    region: str, depth: float, count: int, receptive_field: float, rng: np.random.Generator
) -> Noticed:
    """Poke random points of the skin of a region with a fingertip, along the normal of the skin.

    Points are distributed by area and lie on skin that no other bone covers.

    Args:
        region: See `REGIONS`.
        depth: Penetration as a share of the thickness of both skins.
        count: Number of pokes.
        receptive_field: See `TouchCfg`.
        rng: Chooses the points.
    """
    body = BareBody(TouchCfg(receptive_field=receptive_field), *FINGERTIP, FINGERTIP_SKIN_M)
    bones = [load_skeleton().bone(name) for name in REGIONS[region]]
    length_m = FINGERTIP[1][0] + FINGERTIP[1][1] / 2
    largest = []
    for _ in range(count):
        bone, place, normal = body.random_point(bones, rng)
        skin_m = load_skeleton().bones[bone].skin_thickness_m + FINGERTIP_SKIN_M
        readings = body.read((place + (length_m - depth * skin_m) * normal, normal))
        largest.append(readings.max())
    values = np.array(largest)
    return Noticed(float((values > NOTICED).mean()), float(values.mean()))
