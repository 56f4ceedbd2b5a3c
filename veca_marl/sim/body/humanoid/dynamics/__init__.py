"""Rigid-body dynamics of a tree of hinges with a free base: compiled kernels and their arrays."""

from veca_marl.sim.body.humanoid.dynamics.body_dynamics import BodyDynamics

__all__ = ["BodyDynamics"]
