"""Experts on the frozen episodes of every task: ``python -m veca_marl.experts_table``."""

from veca_marl.experts_table.command import main

__all__ = ["main"]
