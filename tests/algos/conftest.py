"""Small networks: one thread is faster than several that wait for each other."""

import logging

import pytest
import torch
from fake_env import FakeEnv
from training import SMALL

from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.ppo.value_normalisation import ValueNormalisation
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners


@pytest.fixture(autouse=True, scope="session")
def one_thread():
    torch.set_num_threads(1)
    logging.getLogger("torchrl").setLevel(logging.WARNING)


@pytest.fixture
def make_ppo():
    def make(seed=0, network=SMALL, value_normalisation=ValueNormalisation.none, **env):
        torch.manual_seed(seed)
        return TeamLearners(
            team_specs(FakeEnv(1, **env)),
            PPOCfg(network=network, value_normalisation=value_normalisation),
            torch.device("cpu"),
        )

    return make
