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
BONES = tuple(bone.name for bone in load_skeleton().bones if not bone.name.startswith("r_"))
"""Bones that are poked; the right side mirrors the left."""


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
    bone: str, depth: float, count: int, receptive_field: float, rng: np.random.Generator
) -> Noticed:
    """Poke random points of the skin of a bone with a fingertip, along the normal of the skin.

    Points are distributed by area and lie on skin that no other bone covers.

    Args:
        bone: Its name.
        depth: Penetration as a share of the thickness of both skins.
        count: Number of pokes.
        receptive_field: See `TouchCfg`.
        rng: Chooses the points.
    """
    body = BareBody(TouchCfg(receptive_field=receptive_field), *FINGERTIP, FINGERTIP_SKIN_M)
    index = load_skeleton().bone(bone)
    skin_m = load_skeleton().bones[index].skin_thickness_m + FINGERTIP_SKIN_M
    length_m = FINGERTIP[1][0] + FINGERTIP[1][1] / 2
    largest = []
    for _ in range(count):
        place, normal = body.random_point(index, rng)
        readings = body.read((place + (length_m - depth * skin_m) * normal, normal))
        largest.append(readings.max())
    values = np.array(largest)
    return Noticed(float((values > NOTICED).mean()), float(values.mean()))
