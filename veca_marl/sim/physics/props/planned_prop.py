"""Props without a world: where the shapes of a playground stand before anything is built."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from veca_marl.sim.geometry import Floats, Geom, rotation_about_vertical
from veca_marl.sim.physics.props.geoms import horizontal_radius_m, prop_geoms, prop_radius_m
from veca_marl.sim.physics.props.joint import JointCfg, JointKind
from veca_marl.sim.physics.props.prop_cfg import PropCfg


class StandingProp(Protocol):
    """What the search for free floor reads of a `Prop` or a `PlannedProp`; see these."""

    @property
    def geoms(self) -> tuple[Geom, ...]:
        """Its primitives, in its own frame."""

    @property
    def reach_m(self) -> float:
        """Horizontal radius of the cylinder about its origin that contains them, untilted."""

    @property
    def radius_m(self) -> float:
        """As `Prop.radius_m`, metres."""

    @property
    def fixed(self) -> bool:
        """Whether it is part of the building."""

    @property
    def position(self) -> Floats:
        """``(3,)`` metres, world frame."""

    @property
    def rotation(self) -> Floats:
        """``(3, 3)`` rotation to the world frame."""


class PlannedProp:
    """A prop at the pose in which it would stand at the start of an episode.

    With it the placement of a task can be tried out in a millisecond, where a world takes longer.

    Args:
        cfg: The prop.

    Attributes:
        geoms: Its primitives, in its own frame.
        reach_m: Horizontal radius of the cylinder about its origin that contains them, untilted.
        radius_m: As `Prop.radius_m`.
        fixed: Whether it is part of the building.
        position: ``(3,)`` metres, world frame.
        rotation: ``(3, 3)`` rotation to the world frame.
    """

    def __init__(self, cfg: PropCfg) -> None:
        self._joint = cfg.joint
        self.geoms = prop_geoms(cfg)
        self.reach_m = horizontal_radius_m(self.geoms)
        self.radius_m = prop_radius_m(cfg, self.reach_m)
        self.fixed = cfg.mass_kg == 0.0
        self.place(cfg.position_m, math.radians(cfg.yaw_deg))

    def place(self, position: Sequence[float] | Floats, yaw_rad: float = 0.0) -> None:
        """Set the pose; that of the closed prop for one with a joint, as in `Prop.place`."""
        self.position: Floats = np.array(position, float)
        self.rotation: Floats = rotation_about_vertical(yaw_rad)
        if self._joint is not None:
            self._open(self._joint)

    def _open(self, joint: JointCfg) -> None:
        """Move from the closed pose to the opening at the start of an episode."""
        axis = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
        travel = axis * joint.opening * joint.range
        if joint.kind is JointKind.slide:
            self.position = self.position + self.rotation @ travel
            return
        turn = Rotation.from_rotvec(travel).as_matrix()
        anchor = np.asarray(joint.anchor_m)
        self.position = self.position + self.rotation @ (anchor - turn @ anchor)
        self.rotation = self.rotation @ turn
