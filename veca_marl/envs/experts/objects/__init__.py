"""Experts of the tasks with objects: grasping, moving, rotating, piling up, putting down."""
