"""The walking body: a capsule in the physics, animated by forward kinematics."""
