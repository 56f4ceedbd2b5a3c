"""The parts of a walker's action: velocities or moves, and verbs."""
