"""The parameters of the joint-level body."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.body.body_cfg import BodyCfg
from veca_marl.sim.body.humanoid.joint_control import JointActionKind, JointChoice


class Detail(Enum):
    """Level of detail: with all fingers, or with straight fingers fixed to the hands."""

    full = "full"
    mitten = "mitten"


@dataclass
class HumanoidCfg(BodyCfg):
    """Parameters of the joint-level body.

    Attributes:
        detail: `full` moves 82 joints; `mitten`, a body with fixed fingers, moves 40, and an agent
            step takes half to two thirds of the time. Actions, senses and names are the same: a
            `mitten` ignores the actions of its fingers.
        action: Normalised torques, target angles, or increments of target angles.
        joints: Which joints the action moves: all 82, the 40 that are not in fingers, or the 14 of
            both arms.
        strength: Fraction of the torques in the table of joints, above 0 and at most 1.
        friction: Lateral friction of the skin.
    """

    detail: Detail = Detail.full
    action: JointActionKind = JointActionKind.torque
    joints: JointChoice = JointChoice.all
    strength: float = 1.0
    friction: float = 0.8

    def __post_init__(self) -> None:
        """Check the choices and the numbers."""
        super().__post_init__()
        self._check_choices(detail=Detail, action=JointActionKind, joints=JointChoice)
        if not 0.0 < self.strength <= 1.0:
            raise ValueError(f"body.strength={self.strength} must be above 0 and at most 1")
