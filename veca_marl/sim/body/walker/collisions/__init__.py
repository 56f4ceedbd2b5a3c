"""Collisions of walkers: with props, doors and walls, with other walkers, and the ground."""
