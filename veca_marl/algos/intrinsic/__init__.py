"""Intrinsic rewards: independent of the task and of the algorithm that learns from them."""

from veca_marl.algos.intrinsic.intrinsic_reward import (
    IntrinsicCfg,
    IntrinsicReward,
    register_intrinsic,
)
from veca_marl.algos.intrinsic.predictors import RND, ForwardModel, ForwardModelCfg, RNDCfg

__all__ = [
    "RND",
    "ForwardModel",
    "ForwardModelCfg",
    "IntrinsicCfg",
    "IntrinsicReward",
    "RNDCfg",
    "register_intrinsic",
]
