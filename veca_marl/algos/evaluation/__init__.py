"""Evaluation of policies: whole episodes in separate worlds, their scores and comparisons."""
