"""Leaves of hinged and of sliding doors."""

from __future__ import annotations

from veca_marl.sim.physics.props.joint import JointCfg, JointKind, LockCfg
from veca_marl.sim.physics.props.prop_cfg import PartCfg, PropCfg, PropShape

Colour = tuple[float, float, float]

DOOR_KG = 3.0
"""Light enough for a walker (`push_limit_kg` is 5 by default); a real leaf has about 20 kg."""

LEAF_WALL_M = 0.05
"""Least thickness of a wall with a leaf in its door."""

LEAF_M = 0.04
"""Thickness of a leaf."""

_GAP_M = 0.01  # to the frame on either side and to the floor
_HANDLE_HEIGHT_M = 0.45  # within reach of a child of 0.78 m
_METAL: Colour = (0.75, 0.75, 0.78)
_WOOD: Colour = (0.80, 0.62, 0.42)
_HANDLE_M = 0.03  # by which the handle of a hinged leaf stands out
_PULL_M = 0.002  # by which the shallow handle of a sliding leaf stands out
_LEFT_OUT_M = 0.12  # of an open sliding leaf, so that its handle is seen and the door can be closed


def door_leaf(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float,
    width_m: float,
    height_m: float = 2.0,
    *,
    opens_to_front: bool = True,
    lock: LockCfg | None = None,
    colour: Colour = _WOOD,
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

    Raises:
        ValueError: If nothing is left of a leaf for that opening, or of its way.
    """
    _check_opening(name, width_m, height_m, 2.0 * _GAP_M)
    width = width_m - 2.0 * _GAP_M
    side = 1.0 if opens_to_front else -1.0
    hinge = JointCfg(
        axis=(0.0, 0.0, -side),
        anchor_m=(side * LEAF_M / 2.0, -width / 2.0, 0.0),
        range_deg=90.0,
        lock=lock,
    )
    parts = _leaf_parts(width, height_m, _HANDLE_M, width / 2.0 - 0.08)
    return _leaf(name, (*position_m, height_m / 2.0), yaw_deg, parts, hinge, colour, mass_kg)


def sliding_leaf(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float,
    width_m: float,
    height_m: float = 2.0,
    *,
    wall: str,
    slides_to_left: bool = True,
    lock: LockCfg | None = None,
    colour: Colour = _WOOD,
    mass_kg: float = DOOR_KG,
) -> PropCfg:
    """Return a leaf that closes an opening in a wall and slides into the wall beside it.

    Its frame has x through the opening and y along its width. Open, 12 cm of it stay in the
    opening, with the handle.

    Args:
        name: Name of the prop.
        position_m: Middle of the threshold.
        yaw_deg: Rotation about z; at 0 the opening leads along x.
        width_m: Clear width of the closed opening, more than 14 cm; the leaf is 2 cm narrower.
        height_m: Clear height of the opening.
        wall: Name of the fixed prop into which it slides, at least `LEAF_WALL_M` thick and as
            long as the leaf.
        slides_to_left: Whether it slides to the side of +y; otherwise to -y.
        lock: Its lock.
        colour: Of the leaf.
        mass_kg: Its mass.

    Raises:
        ValueError: If nothing is left of a leaf for that opening, or of its way.
    """
    _check_opening(name, width_m, height_m, 2.0 * _GAP_M + _LEFT_OUT_M)
    width = width_m - 2.0 * _GAP_M
    side = 1.0 if slides_to_left else -1.0
    slide = JointCfg(
        JointKind.slide,
        parent=wall,
        axis=(0.0, side, 0.0),
        range_m=width - _LEFT_OUT_M,
        friction=1.0,
        lock=lock,
    )
    parts = _leaf_parts(width, height_m, _PULL_M, -side * (width / 2.0 - 0.06))
    return _leaf(name, (*position_m, height_m / 2.0), yaw_deg, parts, slide, colour, mass_kg)


def _check_opening(name: str, width_m: float, height_m: float, least_width_m: float) -> None:
    for field, value, least in (
        ("width_m", width_m, least_width_m),
        ("height_m", height_m, 2.0 * _GAP_M),
    ):
        if not value > least:
            raise ValueError(f"{name}: {field}={value:g} of the opening must be above {least:g}")


def open_reach_m(width_m: float) -> float:
    """Return how far the open leaf of a sliding door of a clear width reaches into its wall."""
    return width_m - 3.0 * _GAP_M - _LEFT_OUT_M


def _leaf(
    name: str,
    position_m: tuple[float, float, float],
    yaw_deg: float,
    parts: list[PartCfg],
    joint: JointCfg,
    colour: Colour,
    mass_kg: float,
) -> PropCfg:
    return PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=position_m,
        yaw_deg=yaw_deg,
        mass_kg=mass_kg,
        colour=colour,
        parts=parts,
        partition=True,
        interactions=["open", "close"],
        joint=joint,
    )


def _leaf_parts(width: float, height_m: float, handle_m: float, handle_y: float) -> list[PartCfg]:
    """Return a leaf for an opening of a height, and handles on both faces.

    Args:
        width: Width of the leaf, m.
        height_m: Clear height of the opening.
        handle_m: By how much the handles stand out.
        handle_y: Their place along the width.
    """
    parts = [PartCfg(PropShape.box, [LEAF_M, width, height_m - 2.0 * _GAP_M])]
    for face in (-1.0, 1.0):
        out = face * (LEAF_M + handle_m) / 2.0
        place = (out, handle_y, _HANDLE_HEIGHT_M - height_m / 2.0)
        parts.append(PartCfg(PropShape.box, [handle_m, 0.1, 0.02], place, colour=_METAL))
    return parts
