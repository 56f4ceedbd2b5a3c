"""Shared geometry: primitives, the scene, poses, rotations, distances, rays, meshes."""
