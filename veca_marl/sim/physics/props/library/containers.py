"""Open baskets, and chests with a lid."""

from __future__ import annotations

from veca_marl.sim.physics.props.joint_cfg import JointCfg, LockCfg
from veca_marl.sim.physics.props.library.sizes import check_size
from veca_marl.sim.physics.props.part_cfg import PartCfg
from veca_marl.sim.physics.props.prop_cfg import PropCfg
from veca_marl.sim.physics.props.prop_shape import PropShape

Colour = tuple[float, float, float]

_BOARD_M = 0.015


def basket(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float = 0.0,
    size_m: tuple[float, float, float] = (0.4, 0.4, 0.15),
    *,
    mass_kg: float = 0.0,
    colour: Colour = (0.72, 0.55, 0.33),
) -> PropCfg:
    """Return an open box of four walls and a floor; see `Prop.contains`.

    Args:
        name: Name of the prop.
        position_m: Middle of its floor area; the origin of its frame is below, on the floor.
        yaw_deg: Rotation about z.
        size_m: Outer edges along x and y, and height.
        mass_kg: Its mass; 0 for a fixed one.
        colour: Of its walls.

    Raises:
        ValueError: If the boards of 15 mm leave no interior.
    """
    sides_m = 2.0 * _BOARD_M
    check_size(name, size_m, (sides_m, sides_m, _BOARD_M), "an interior between boards")
    return PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=(*position_m, 0.0),
        yaw_deg=yaw_deg,
        mass_kg=mass_kg,
        colour=colour,
        parts=_open_box(*size_m),
        interactions=["put_into"],
    )


def chest(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float = 0.0,
    size_m: tuple[float, float, float] = (0.35, 0.55, 0.3),
    *,
    lock: LockCfg | None = None,
    colour: Colour = (0.75, 0.45, 0.20),
) -> list[PropCfg]:
    """Return a fixed open box, and a lid with a hinge at its back edge, in -x.

    The lid is called ``name.lid`` and opens by 100 degrees.

    Args:
        name: Name of the box.
        position_m: Middle of its floor area.
        yaw_deg: Rotation about z.
        size_m: Depth along x, width along y, height with the lid.
        lock: Lock of the lid.
        colour: Of box and lid.

    Raises:
        ValueError: If the boards of 15 mm and the lid of 30 mm leave no interior.
    """
    sides_m = lid_m = 2.0 * _BOARD_M
    above_m = (sides_m, sides_m, lid_m + _BOARD_M)
    check_size(name, size_m, above_m, "an interior between boards below the lid")
    depth, width, height = size_m
    box = basket(name, position_m, yaw_deg, (depth, width, height - lid_m), colour=colour)
    lid = PropCfg(
        name=f"{name}.lid",
        shape=PropShape.box,
        size_m=[depth, width, lid_m],
        position_m=(*position_m, height - lid_m / 2.0),
        yaw_deg=yaw_deg,
        mass_kg=0.8,
        colour=colour,
        interactions=["open", "close"],
        joint=JointCfg(
            parent=name,
            axis=(0.0, -1.0, 0.0),
            anchor_m=(-depth / 2.0, 0.0, -lid_m / 2.0),
            range_deg=100.0,
            friction=0.4,
            lock=lock,
        ),
    )
    return [box, lid]


def _open_box(length_x: float, length_y: float, height: float) -> list[PartCfg]:
    """Return floor and walls; the origin is the middle of the foot."""
    floor = [length_x, length_y, _BOARD_M]
    parts = [PartCfg(PropShape.box, floor, (0.0, 0.0, _BOARD_M / 2.0))]
    for side in (-1.0, 1.0):
        x, y = side * (length_x - _BOARD_M) / 2.0, side * (length_y - _BOARD_M) / 2.0
        parts.append(PartCfg(PropShape.box, [_BOARD_M, length_y, height], (x, 0.0, height / 2.0)))
        parts.append(PartCfg(PropShape.box, [length_x, _BOARD_M, height], (0.0, y, height / 2.0)))
    return parts
