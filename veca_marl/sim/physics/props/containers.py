"""Things made of boards: open baskets, chests with a lid, cupboards with a drawer."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.sim.physics.props.joint import JointCfg, JointKind, LockCfg
from veca_marl.sim.physics.props.prop_cfg import PartCfg, PropCfg, PropShape

Colour = tuple[float, float, float]


def check_size(name: str, size_m: Sequence[float], above_m: Sequence[float], needed: str) -> None:
    """Check that something is left between the boards of a thing.

    Args:
        name: Name of the prop.
        size_m: Its extents along x, y and z.
        above_m: What they must be above.
        needed: What needs so much, for the message.

    Raises:
        ValueError: If the sizes are not three, or one is too small.
    """
    fits = len(size_m) == len(above_m) and all(
        size > least for size, least in zip(size_m, above_m, strict=True)
    )
    if not fits:
        leasts = ", ".join(f"{least:g}" for least in above_m)
        raise ValueError(f"{name}: size_m={tuple(size_m)} must be above ({leasts}), for {needed}")


_CUPBOARD_BOARD_M = 0.02
_DRAWER_BOARD_M = 0.01  # of the floor, the sides and the back of a drawer
_SIDE_SHARE = 0.75  # height of the sides of a drawer as a share of that of its front
_GAP_M = 0.006
_METAL: Colour = (0.75, 0.75, 0.78)


def cupboard_with_drawer(
    name: str,
    position_m: tuple[float, float],
    yaw_deg: float = 0.0,
    size_m: tuple[float, float, float] = (0.4, 0.45, 0.5),
    *,
    drawer_height_m: float = 0.16,
    lock: LockCfg | None = None,
    colour: Colour = (0.55, 0.38, 0.24),
) -> list[PropCfg]:
    """Return a fixed cupboard, and the drawer at its top, which slides out to +x.

    The cupboard is a case of boards that is open to +x; below the drawer it is empty. The drawer
    is called ``name.drawer`` and opens by three quarters of its depth.

    Args:
        name: Name of the cupboard.
        position_m: Middle of its floor area.
        yaw_deg: Rotation about z.
        size_m: Depth along x, width along y, height.
        drawer_height_m: Height of the drawer's front.
        lock: Lock of the drawer.
        colour: Of its boards.

    Raises:
        ValueError: If the drawer has no interior, or does not fit into the cupboard.
    """
    _check_sizes(name, size_m, drawer_height_m)
    depth, width, height = size_m
    case = PropCfg(
        name=name,
        shape=PropShape.compound,
        position_m=(*position_m, 0.0),
        yaw_deg=yaw_deg,
        colour=colour,
        parts=_case(depth, width, height, drawer_height_m),
    )
    inner = width - 2.0 * (_CUPBOARD_BOARD_M + _GAP_M)
    length = depth - _CUPBOARD_BOARD_M - _GAP_M
    middle = height - _CUPBOARD_BOARD_M - _GAP_M - drawer_height_m / 2.0
    drawer = PropCfg(
        name=f"{name}.drawer",
        shape=PropShape.compound,
        position_m=(*position_m, middle),
        yaw_deg=yaw_deg,
        mass_kg=1.0,
        colour=colour,
        parts=_drawer(depth, length, inner, drawer_height_m),
        interactions=["open", "close"],
        joint=JointCfg(
            JointKind.slide,
            parent=name,
            axis=(1.0, 0.0, 0.0),
            range_m=0.75 * length,
            friction=1.0,
            lock=lock,
        ),
    )
    return [case, drawer]


def _check_sizes(name: str, size_m: tuple[float, float, float], drawer_height_m: float) -> None:
    least_m = _DRAWER_BOARD_M / _SIDE_SHARE
    if not drawer_height_m > least_m:
        raise ValueError(
            f"{name}: drawer_height_m={drawer_height_m:g} must be above {least_m:.3g}, for an "
            "interior of the drawer"
        )
    above_m = (
        2.0 * _CUPBOARD_BOARD_M + _GAP_M + _DRAWER_BOARD_M,
        2.0 * (_CUPBOARD_BOARD_M + _GAP_M + _DRAWER_BOARD_M),
        drawer_height_m + 3.0 * _CUPBOARD_BOARD_M + 2.0 * _GAP_M,
    )
    needed = f"boards and a drawer with drawer_height_m={drawer_height_m:g}"
    check_size(name, size_m, above_m, needed)


def _case(depth: float, width: float, height: float, drawer_height: float) -> list[PartCfg]:
    """Return top, bottom, sides, back and the board below the drawer."""
    below = height - 1.5 * _CUPBOARD_BOARD_M - 2.0 * _GAP_M - drawer_height
    boards = [
        PartCfg(PropShape.box, [depth, width, _CUPBOARD_BOARD_M], (0.0, 0.0, z))
        for z in (_CUPBOARD_BOARD_M / 2.0, below, height - _CUPBOARD_BOARD_M / 2.0)
    ]
    for side in (-1.0, 1.0):
        y = side * (width - _CUPBOARD_BOARD_M) / 2.0
        boards.append(
            PartCfg(PropShape.box, [depth, _CUPBOARD_BOARD_M, height], (0.0, y, height / 2.0))
        )
    back = (-(depth - _CUPBOARD_BOARD_M) / 2.0, 0.0, height / 2.0)
    boards.append(PartCfg(PropShape.box, [_CUPBOARD_BOARD_M, width, height], back))
    return boards


def _drawer(depth: float, length: float, width: float, height: float) -> list[PartCfg]:
    """Return floor, sides, back, front and handle; the front is flush with the case."""
    thin, front = _DRAWER_BOARD_M, depth / 2.0
    middle = front - length / 2.0
    side_height = _SIDE_SHARE * height
    low = -height / 2.0
    parts = [PartCfg(PropShape.box, [length, width, thin], (middle, 0.0, low + thin / 2.0))]
    for side in (-1.0, 1.0):
        y = side * (width - thin) / 2.0
        parts.append(
            PartCfg(PropShape.box, [length, thin, side_height], (middle, y, low + side_height / 2))
        )
    rear = (front - length + thin / 2.0, 0.0, low + side_height / 2.0)
    parts.append(PartCfg(PropShape.box, [thin, width, side_height], rear))
    parts.append(
        PartCfg(PropShape.box, [_CUPBOARD_BOARD_M, width, height], (front - thin, 0.0, 0.0))
    )
    knob = (front + 0.015, 0.0, 0.0)
    parts.append(PartCfg(PropShape.box, [0.03, 0.1, 0.02], knob, colour=_METAL))
    return parts


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
