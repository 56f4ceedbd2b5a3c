"""Experts on the frozen episodes of every task: ``python -m tools.experts_table``."""

from tools.experts_table.command import main

__all__ = ["main"]
