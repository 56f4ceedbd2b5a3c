"""The joint-level body: an articulated multibody driven by torques or set-points."""
