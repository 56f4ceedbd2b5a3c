"""Sounds of things that hit each other or the floor."""
