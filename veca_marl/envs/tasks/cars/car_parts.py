"""The parts of the toy car: chassis, cabin, four wheels."""

from __future__ import annotations

from veca_marl.sim.physics import PropShape
from veca_marl.sim.physics.props.prop_cfg import PartCfg

LENGTH_M, WIDTH_M, HEIGHT_M = 0.34, 0.2, 0.16
_WHEEL_M, _TYRE_M = 0.04, 0.03  # radius and width of a wheel
_CHASSIS_M = 0.07  # height
_GLASS, _RUBBER = (0.25, 0.35, 0.45), (0.1, 0.1, 0.1)


def car_parts() -> list[PartCfg]:
    """Return the parts, front along x, with the middle of the bounding box at the origin."""
    low_m = -HEIGHT_M / 2.0
    chassis_z = low_m + 0.5 * _WHEEL_M + _CHASSIS_M / 2.0
    cabin_m = HEIGHT_M / 2.0 - (chassis_z + _CHASSIS_M / 2.0)
    parts = [
        PartCfg(PropShape.box, [LENGTH_M, WIDTH_M - 2.0 * _TYRE_M, _CHASSIS_M], (0, 0, chassis_z)),
        PartCfg(
            PropShape.box,
            [0.45 * LENGTH_M, 0.6 * WIDTH_M, cabin_m],
            (-0.12 * LENGTH_M, 0.0, HEIGHT_M / 2.0 - cabin_m / 2.0),
            colour=_GLASS,
        ),
    ]
    for x in (-0.3 * LENGTH_M, 0.3 * LENGTH_M):
        for y in (-(WIDTH_M - _TYRE_M) / 2.0, (WIDTH_M - _TYRE_M) / 2.0):
            parts.append(
                PartCfg(
                    PropShape.cylinder,
                    [_WHEEL_M, _TYRE_M],
                    (x, y, low_m + _WHEEL_M),
                    (90.0, 0.0, 0.0),
                    _RUBBER,
                )
            )
    return parts
