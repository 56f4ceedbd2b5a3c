"""The doll: a toy in the form of a child, as parts of a compound."""

from __future__ import annotations

from veca_marl.sim.physics.props.part_cfg import PartCfg
from veca_marl.sim.physics.props.prop_shape import PropShape

SKIN = (0.95, 0.78, 0.65)
HAIR = (0.35, 0.22, 0.12)


def doll_parts(height_m: float) -> list[PartCfg]:
    """Return the parts of a doll that stands with the middle of its height at the origin.

    Its face is turned to x. The proportions are ours; it stands on two flat feet.

    Args:
        height_m: From the feet to the top of the hair.
    """
    h = height_m
    parts = [
        PartCfg(PropShape.sphere, [0.15 * h], (0.0, 0.0, 0.34 * h), colour=SKIN),
        PartCfg(PropShape.sphere, [0.14 * h], (-0.03 * h, 0.0, 0.36 * h), colour=HAIR),
        PartCfg(PropShape.capsule, [0.12 * h, 0.18 * h], (0.0, 0.0, 0.06 * h)),
    ]
    for side in (-1.0, 1.0):
        parts += _limbs(h, side)
    return parts


def _limbs(h: float, side: float) -> list[PartCfg]:
    """Return the arm, the leg and the foot of one side."""
    return [
        PartCfg(
            PropShape.capsule,
            [0.045 * h, 0.22 * h],
            (0.0, side * 0.18 * h, 0.07 * h),
            (-side * 25.0, 0.0, 0.0),
            SKIN,
        ),
        PartCfg(PropShape.capsule, [0.06 * h, 0.2 * h], (0.0, side * 0.075 * h, -0.28 * h)),
        PartCfg(
            PropShape.box,
            [0.2 * h, 0.11 * h, 0.06 * h],
            (0.03 * h, side * 0.075 * h, -0.47 * h),
            colour=HAIR,
        ),
    ]
