"""Rasterization and deferred shading of primitives, polyhedra and meshes in compiled loops."""
