"""The skeleton, its inertia, its skin mesh and its URDF."""
