"""Sitting up while the arms are busy: trunk and hips bear what leans forward."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.anatomy.inertia import bone_inertia
from veca_marl.sim.body.anatomy.skeleton import forward_kinematics, load_skeleton
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.joint_controls import REACH_RAD, JointActionKind
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.world import GRAVITY_MPS2

_TRUNK = ("spine", "chest", "neck", "head")
_LEGS = ("thigh", "shank", "foot")
_SIDES = ("l", "r")
_LEANS = ("flexion", "lateral")
_DAMPING_S = 0.03  # a trunk that sways is sent back by so much of its speed
_GAIN = 0.03  # share of the remaining sag that is given back per call
_NUDGE_RAD = 1e-4


class SeatedBalance:
    """Holds a sitting child between two postures against the weight of trunk, head and arms.

    Joints are springs: sent to an angle, they sag under weight. So they are sent beyond it, by as
    much as the weight asks for and, in small steps, by what they still sag. Only forward bending is
    corrected: correcting sideways as well makes the child roll over.

    Args:
        body: Who sits.
        upright: How it sits.
        bent: How it bends forward.
    """

    def __init__(self, body: Humanoid, upright: Posture, bent: Posture) -> None:
        self._body, self._skeleton = body, load_skeleton()
        self.upright, self._bent = body.angles_of(upright), body.angles_of(bent)
        bones = self._skeleton.bones
        inertias = [bone_inertia(bone) for bone in bones]
        self._masses = np.array([inertia.mass_kg for inertia in inertias])
        self._centres = np.array([inertia.centre for inertia in inertias])
        self._above = np.array([not bone.name.endswith(_LEGS) for bone in bones])
        joint = self._skeleton.joint
        self._trunk = [joint(bone, label) for label in _LEANS for bone in _TRUNK]
        self._hips = [joint(f"{side}_thigh", "flexion") for side in _SIDES]
        self._bending = [*self._trunk[: len(_TRUNK)], *self._hips]
        self._given = np.zeros(len(self._bending))

    def reset(self) -> None:
        """Forget the sag of the last episode."""
        self._given[:] = 0.0

    def hold(self, wish: Floats, bend: float) -> Floats:
        """Return a wish with the trunk's and the legs' part for one step. Call it once per step.

        Args:
            wish: ``(82,)`` rad, with the angles of the arms.
            bend: From 0, upright, to 1, bent.
        """
        way = self._bent - self.upright
        held = np.where(way == 0.0, wish, self.upright + bend * way)
        sag = (held - self._body.joint_angles())[self._bending]
        self._given = np.clip(self._given + _GAIN * sag, -REACH_RAD, REACH_RAD)
        held[self._bending] += self._given
        held[[*self._trunk, *self._hips]] += self._borne()
        held[self._trunk] -= _DAMPING_S * self._body.joint_velocities()[self._trunk]
        return self._eased(held)

    def _eased(self, wish: Floats) -> Floats:
        """Return how a body driven by angles is to be told a wish: as gently as by torques."""
        if self._body.cfg.action is not JointActionKind.position:
            return wish
        return self._body.joint_angles() + wish - self._body.foresee(wish)

    def _borne(self) -> Floats:
        """Return by how much the weight bends trunk and hips, rad."""
        angles = self._body.joint_angles()
        positions, rotations = self._body.bone_positions(), self._body.bone_rotations()
        lean_nm = self._lean_nm(positions, rotations)
        rest_j = self._energy_j(angles, positions, rotations)
        moments = []
        for joint in self._trunk:
            angles[joint] += _NUDGE_RAD
            moments.append((self._energy_j(angles, positions, rotations) - rest_j) / _NUDGE_RAD)
            angles[joint] -= _NUDGE_RAD
        moments += [-lean_nm / len(self._hips)] * len(self._hips)
        strengths = self._body.articulation.strengths_nm[[*self._trunk, *self._hips]]
        return REACH_RAD * np.clip(np.array(moments) / strengths, -1.0, 1.0)

    def _energy_j(self, angles: Floats, positions: Floats, rotations: Floats) -> float:
        """Return the potential energy of the bones in a pose, which is written to the arrays."""
        forward_kinematics(self._skeleton, angles, positions, rotations)
        heights = positions[:, 2] + (rotations[:, 2] * self._centres).sum(axis=1)
        return GRAVITY_MPS2 * float(self._masses @ heights)

    def _lean_nm(self, positions: Floats, rotations: Floats) -> float:
        """Return the moment with which all but the legs tips forward over the hips."""
        centres = positions + np.einsum("bij,bj->bi", rotations, self._centres)
        ahead = (centres - positions[0]) @ self._body.forward
        return GRAVITY_MPS2 * float(self._masses[self._above] @ ahead[self._above])
