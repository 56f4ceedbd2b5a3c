"""Tasks of manipulation: grasping, moving, turning and piling objects."""
