"""Demonstrations: recorded by experts, read, exported, compared with what is learnt from them."""

from veca_marl.algos.demonstration_files import DemonstrationsError
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.demonstrations.command import main

__all__ = ["Demonstrations", "DemonstrationsError", "main"]
