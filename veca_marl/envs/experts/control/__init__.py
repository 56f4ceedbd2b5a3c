"""Controllers that experts share: locomotion, path following, key poses, inverse kinematics."""
