"""Proximal policy optimisation."""

from veca_marl.algos.algorithm import register_algorithm
from veca_marl.algos.ppo.ppo import PPO, PPOCfg

register_algorithm("ppo", PPOCfg, PPO)

__all__ = ["PPO", "PPOCfg"]
