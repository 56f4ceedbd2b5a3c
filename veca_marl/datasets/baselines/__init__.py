"""Baselines: what the encoders of the agents learn of each data set."""
