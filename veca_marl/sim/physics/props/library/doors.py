"""Leaves of hinged doors."""

from __future__ import annotations

from veca_marl.sim.physics.props.joint_cfg import JointCfg, LockCfg
from veca_marl.sim.physics.props.part_cfg import PartCfg
from veca_marl.sim.physics.props.prop_cfg import PropCfg
from veca_marl.sim.physics.props.prop_shape import PropShape

Colour = tuple[float, float, float]

DOOR_KG = 3.0
"""Light enough for a walker (`push_limit_kg` is 5 by default); a real leaf has about 20 kg."""

_GAP_M = 0.01  # to the frame on either side and to the floor
_THICKNESS_M = 0.04
_HANDLE_HEIGHT_M = 0.45  # within reach of a child of 0.78 m
_METAL: Colour = (0.75, 0.75, 0.78)


def door_leaf(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float,
    width_m: float,
    height_m: float = 2.0,
    *,
    opens_to_front: bool = True,
    lock: LockCfg | None = None,
    colour: Colour = (0.80, 0.62, 0.42),
    mass_kg: float = DOOR_KG,
) -> PropCfg:
    """Return a hinged leaf that closes an opening in a wall and turns by 90 degrees.

    Its frame has x through the opening and y along its width. The hinge is at the end in -y, in
    the face on the side to which it opens, so that no edge turns into the wall.

    Args:
        name: Name of the prop.
        position_m: Middle of the threshold.
        yaw_deg: Rotation about z; at 0 the opening leads along x.
        width_m: Clear width of the opening; the leaf is 2 cm narrower.
        height_m: Clear height of the opening.
        opens_to_front: Whether it opens to the side of +x; otherwise to -x.
        lock: Its lock.
        colour: Of the leaf.
        mass_kg: Its mass.
    """
    width, height = width_m - 2.0 * _GAP_M, height_m - 2.0 * _GAP_M
    parts = [PartCfg(PropShape.box, [_THICKNESS_M, width, height])]
    for face in (-1.0, 1.0):
        out = face * (_THICKNESS_M / 2.0 + 0.015)
        place = (out, width / 2.0 - 0.08, _HANDLE_HEIGHT_M - height_m / 2.0)
        parts.append(PartCfg(PropShape.box, [0.03, 0.1, 0.02], place, colour=_METAL))
    side = 1.0 if opens_to_front else -1.0
    return PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=(*position_m, height_m / 2.0),
        yaw_deg=yaw_deg,
        mass_kg=mass_kg,
        colour=colour,
        parts=parts,
        interactions=["open", "close"],
        joint=JointCfg(
            axis=(0.0, 0.0, -side),
            anchor_m=(side * _THICKNESS_M / 2.0, -width / 2.0, 0.0),
            range_deg=90.0,
            lock=lock,
        ),
    )
