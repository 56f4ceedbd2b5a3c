"""Imitation: behaviour cloning, and learning from an expert that labels."""

from veca_marl.algos.algorithm import register_algorithm
from veca_marl.algos.cloning.bc import BC, BCCfg
from veca_marl.algos.cloning.dagger import Dagger, DaggerCfg

register_algorithm("bc", BCCfg, BC)
register_algorithm("dagger", DaggerCfg, Dagger)

__all__ = ["BC", "BCCfg", "Dagger", "DaggerCfg"]
