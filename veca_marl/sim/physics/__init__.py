"""The PyBullet world, its clock, its props and playgrounds."""
