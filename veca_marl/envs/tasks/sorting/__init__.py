"""Sorting tasks: things that are grabbed and put where they belong."""
