"""Rigid-body dynamics of a tree of hinges with a free base: compiled kernels and their arrays."""

from veca_marl.sim.body.humanoid.body_dynamics import NEW_POSE, SETTLED
from veca_marl.sim.body.humanoid.dynamics.body_dynamics import BodyDynamics
from veca_marl.sim.body.humanoid.link_tree import JointLimits

__all__ = ["NEW_POSE", "SETTLED", "BodyDynamics", "JointLimits"]
