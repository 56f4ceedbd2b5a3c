"""Imitation: behaviour cloning, and learning from an expert that labels."""

from veca_marl.algos.algorithm import register_algorithm
from veca_marl.algos.cloning.bc import BC, BCCfg

register_algorithm("bc", BCCfg, BC)

__all__ = ["BC", "BCCfg"]
