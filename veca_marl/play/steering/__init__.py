"""Steering the first agent: keys as commands of a walking body, the pointer as its gaze."""
