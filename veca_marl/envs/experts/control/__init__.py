"""Controllers that experts share: gaits, key poses, inverse kinematics."""
