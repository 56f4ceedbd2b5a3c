"""A task as a batched TorchRL environment."""

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy

__all__ = ["ExpertPolicy", "VecaEnv"]
