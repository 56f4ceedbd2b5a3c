"""Balance of a sitting body while the arms move: gravity compensation of trunk and hips."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.anatomy import forward_kinematics
from veca_marl.sim.body.humanoid import SATURATION_RAD, Humanoid, JointActionKind
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import GRAVITY_MPS2

_TRUNK = ("spine", "chest", "neck", "head")
_LEGS = ("thigh", "shank", "foot")
_SIDES = ("l", "r")
_LEANS = ("flexion", "lateral")
# Damping of the trunk: change of the target angles per joint velocity. With 0.03 s the pitch of the
# pelvis alternates by 2 degrees from one agent step to the next.
_DAMPING_S = 0.02
# Gravitational moments are those of the joint angles that the present velocities lead to in this
# time. With those of the present angles the trunk sways by 2 degrees with a period of 0.9 s: they
# grow with the lean, as with a negative stiffness, and act one agent step late.
_LEAD_S = 0.12
_DIFFERENCE_RAD = 1e-4  # step of the finite differences


class SeatedBalance:
    """Holds a sitting body between two postures against the weight of trunk, head and arms.

    Joints behave as springs and deviate from their target angles under load. The targets are
    therefore shifted by the deviation that the gravitational moments cause (feed-forward) and by
    an integral of the remaining error (feedback). Feedback acts on forward flexion only: with
    lateral feedback the body rolls over.

    Args:
        body: The body that sits.
        step_s: Duration of an environment step.
        upright: The upright posture.
        bent: The posture with the trunk bent forwards.
        gain_per_s: Share of the remaining error that is added to the targets per second.
    """

    def __init__(
        self,
        body: Humanoid,
        step_s: float,
        upright: Posture,
        bent: Posture,
        gain_per_s: float = 0.75,
    ) -> None:
        self._body, self._skeleton = body, body.skeleton
        self.upright, self._bent = body.posture_angles(upright), body.posture_angles(bent)
        bones = self._skeleton.bones
        inertias = [bone.inertia() for bone in bones]
        self._masses = np.array([inertia.mass_kg for inertia in inertias])
        self._centres = np.array([inertia.centre for inertia in inertias])
        self._above = np.array([not bone.name.endswith(_LEGS) for bone in bones])
        joint = self._skeleton.joint
        self._trunk = [joint(bone, label) for label in _LEANS for bone in _TRUNK]
        self._hips = [joint(f"{side}_thigh", "flexion") for side in _SIDES]
        self._bending = [*self._trunk[: len(_TRUNK)], *self._hips]
        self._gain = gain_per_s * step_s
        self._integral = np.zeros(len(self._bending))

    def reset(self) -> None:
        """Clear the integral of the error."""
        self._integral[:] = 0.0

    def hold(self, targets: Floats, bend: float) -> Floats:
        """Return target angles ``(82,)`` rad with those of trunk and legs set. One call per step.

        Args:
            targets: ``(82,)`` rad, with the target angles of the arms.
            bend: Interpolates from 0, upright, to 1, bent.
        """
        way = self._bent - self.upright
        held = np.where(way == 0.0, targets, self.upright + bend * way)
        error = (held - self._body.joint_angles())[self._bending]
        change = self._gain * error
        self._integral = np.clip(self._integral + change, -SATURATION_RAD, SATURATION_RAD)
        held[self._bending] += self._integral
        held[[*self._trunk, *self._hips]] += self._deflection()
        held[self._trunk] -= _DAMPING_S * self._body.joint_velocities()[self._trunk]
        return self._for_position_control(held)

    def _for_position_control(self, targets: Floats) -> Floats:
        """Return targets that give a position-controlled body the stiffness of torque control."""
        if self._body.action_kind is not JointActionKind.position:
            return targets
        return self._body.joint_angles() + targets - self._body.predict_angles(targets)

    def _deflection(self) -> Floats:
        """Return the angles by which gravity deflects trunk and hips, rad."""
        angles = self._body.joint_angles() + _LEAD_S * self._body.joint_velocities()
        positions, rotations = self._body.bone_positions(), self._body.bone_rotations()
        rest_j = self._energy_j(angles, positions, rotations)
        lean_nm = self._lean_nm(positions, rotations)
        moments = []
        for joint in self._trunk:
            angles[joint] += _DIFFERENCE_RAD
            change_j = self._energy_j(angles, positions, rotations) - rest_j
            moments.append(change_j / _DIFFERENCE_RAD)
            angles[joint] -= _DIFFERENCE_RAD
        moments += [-lean_nm / len(self._hips)] * len(self._hips)
        strengths = self._body.joint_strengths_nm[[*self._trunk, *self._hips]]
        return SATURATION_RAD * np.clip(np.array(moments) / strengths, -1.0, 1.0)

    def _energy_j(self, angles: Floats, positions: Floats, rotations: Floats) -> float:
        """Return the potential energy of all bones at joint angles.

        Args:
            angles: ``(82,)`` rad.
            positions: ``(47, 3)`` metres; overwritten, except for the pelvis.
            rotations: ``(47, 3, 3)``; overwritten, except for the pelvis.
        """
        forward_kinematics(self._skeleton, angles, positions, rotations)
        heights = positions[:, 2] + (rotations[:, 2] * self._centres).sum(axis=1)
        return GRAVITY_MPS2 * float(self._masses @ heights)

    def _lean_nm(self, positions: Floats, rotations: Floats) -> float:
        """Return the forward moment of all bones except the legs about the hips, N m."""
        centres = positions + np.einsum("bij,bj->bi", rotations, self._centres)
        ahead = (centres - positions[0]) @ self._body.forward
        return GRAVITY_MPS2 * float(self._masses[self._above] @ ahead[self._above])
