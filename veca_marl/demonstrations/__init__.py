"""Demonstrations: recorded by experts, read, exported, compared with what is learnt from them."""

from veca_marl.algos.demonstrations import Demonstrations, DemonstrationsError
from veca_marl.demonstrations.command import main

__all__ = ["Demonstrations", "DemonstrationsError", "main"]
