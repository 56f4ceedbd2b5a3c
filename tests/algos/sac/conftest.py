"""A small SAC that learns the toy problem in some 200 updates."""

from dataclasses import replace

import pytest
import torch
from fake_env import FakeEnv
from training import SMALL

from veca_marl.algos.networks.action_values import ActionValuesCfg
from veca_marl.algos.sac import SAC, SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.specs import team_specs

FAST = SACCfg(
    network=SMALL,
    critic=ActionValuesCfg(hidden=[32]),
    policy_hidden=[],
    replay=ReplayCfg(2048, warm_up_frames=64),
    gamma=0.5,
    learning_rate=1e-2,
    updates_per_frame=0.125,
)


@pytest.fixture
def make_sac():
    def make(cfg=FAST, seed=0, senses=("audio",), changes=None, **env):
        torch.manual_seed(seed)
        specs = team_specs(FakeEnv(1, senses=senses, **env))
        return SAC("agents", specs["agents"], replace(cfg, **(changes or {})), torch.device("cpu"))

    return make


@pytest.fixture
def collect():
    @torch.no_grad()
    def collect(algorithm, steps=16, seed=0, senses=("audio",), **env):
        env = FakeEnv(4, seed, senses=senses, **env)
        return env.rollout(steps, policy=algorithm.explorer, break_when_any_done=False)

    return collect
