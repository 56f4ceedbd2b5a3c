"""Checkpoints of runs: written so that none is damaged, checked when they are read."""
