"""Mazes, their walls, and the observation of trials."""
