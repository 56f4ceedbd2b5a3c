"""Soft actor-critic."""

from veca_marl.algos.algorithm import register_algorithm
from veca_marl.algos.sac.config import SACCfg
from veca_marl.algos.sac.sac import SAC

register_algorithm("sac", SACCfg, SAC)

__all__ = ["SAC", "SACCfg"]
