"""Experts of ObjectNav, ObjectPhysNav, MazeNav, MultiAgentNav."""
