"""Small networks on a busy machine: threads that wait for each other cost more than they give."""

import logging

import pytest
import torch
from fake_env import FakeEnv
from training import SMALL

from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners


@pytest.fixture(autouse=True, scope="session")
def one_thread():
    torch.set_num_threads(1)
    logging.getLogger("torchrl").setLevel(logging.WARNING)


@pytest.fixture
def make_ppo():
    def make(seed=0, network=SMALL, **env):
        torch.manual_seed(seed)
        return TeamLearners(
            team_specs(FakeEnv(1, **env)), PPOCfg(network=network), torch.device("cpu")
        )

    return make
