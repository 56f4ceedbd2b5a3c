"""A policy that is called directly gives the arrays of the policy itself, bit by bit."""

from copy import deepcopy
from dataclasses import replace

import pytest
import torch
from fake_env import FakeEnv, make_fake_env
from first_seen import FirstSeenCfg
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL

from veca_marl.algos.acting import DirectPolicy, WritesArrays
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Memory, Parameters
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners

CPU = torch.device("cpu")
GRU = replace(SMALL, memory=Memory.gru, memory_features=16)
TWO_TEAMS = {"teams": ("red", "blue"), "agents": 2}
CASES = {
    "vector": (PPOCfg(network=SMALL), {}),
    "choice": (PPOCfg(network=SMALL), {"discrete": True}),
    "two parts, two teams": (PPOCfg(network=SMALL), {"hybrid": True, **TWO_TEAMS}),
    "hidden state": (PPOCfg(network=GRU), {"agents": 2}),
    "shortcut": (PPOCfg(network=replace(GRU, memory=Memory.gru_shortcut)), {"agents": 2}),
    "own parameters": (PPOCfg(network=replace(GRU, parameters=Parameters.separate)), TWO_TEAMS),
    "network of one's own": (PPOCfg(network=FirstSeenCfg()), {}),
    "warm-up of SAC": (SACCfg(network=SMALL), {"hybrid": True}),
}


def make_policy(cfg, env):
    torch.manual_seed(0)
    policy = TeamLearners(team_specs(FakeEnv(1, **env)), cfg, CPU).policy
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return policy


def play(policy, kind, env):
    playing = with_memory(make_fake_env(3, 0, **env), policy)
    torch.manual_seed(1)
    with torch.no_grad(), set_exploration_type(kind):
        return playing.rollout(12, policy, break_when_any_done=False)


@pytest.mark.parametrize("kind", [ExplorationType.RANDOM, ExplorationType.DETERMINISTIC])
@pytest.mark.parametrize("case", CASES)
def test_all_arrays_are_those_of_the_policy(case, kind):
    cfg, env = CASES[case]
    policy = make_policy(cfg, env).collect
    expected, found = play(policy, kind, env), play(DirectPolicy(deepcopy(policy)), kind, env)
    assert set(found.keys(True, True)) == set(expected.keys(True, True))
    for key, array in expected.items(True, True):
        assert torch.equal(found[key], array), key


def test_modules_of_the_default_network_are_called_directly_and_others_through_a_tensordict():
    def direct(cfg):
        return [writes for _, writes in DirectPolicy(make_policy(cfg, {}).collect)._steps]

    assert all(direct(PPOCfg(network=GRU)))
    assert direct(PPOCfg(network=FirstSeenCfg())) == [False, True, True]
    assert all(direct(SACCfg(network=SMALL)))


def test_an_action_that_is_neither_a_sample_nor_deterministic_is_that_of_the_policy():
    env = {"discrete": True}
    policy = make_policy(PPOCfg(network=SMALL), env).collect
    expected, found = (
        play(p, ExplorationType.MODE, env)["agents", "action"]
        for p in (policy, DirectPolicy(policy))
    )
    assert torch.equal(found, expected)


def test_policies_that_act_are_direct_and_take_over_parameters():
    policy = make_policy(PPOCfg(network=SMALL), {})
    acting = make_policy(PPOCfg(network=SMALL), {}).copy()
    assert isinstance(acting.collect, DirectPolicy)
    assert isinstance(acting.play, DirectPolicy)
    with torch.no_grad():
        next(policy.parameters()).add_(0.1)
    acting.take_over(policy)
    kind = ExplorationType.DETERMINISTIC
    expected, found = (play(p.play, kind, {})["agents", "loc"] for p in (policy, acting))
    torch.testing.assert_close(found, expected)


def test_a_missing_observation_is_named():
    policy = DirectPolicy(make_policy(PPOCfg(network=SMALL), {}).collect)
    state = FakeEnv(2, senses=("audio",)).reset()
    with pytest.raises(KeyError, match="vision"):
        policy(state)


def test_a_module_with_the_method_needs_no_tensordict():
    (module, *_) = make_policy(PPOCfg(network=SMALL), {}).collect.module[0].module
    assert isinstance(module, WritesArrays)
    state = FakeEnv(2).reset()
    arrays = {key: state[key] for key in module.in_keys}
    module.write(arrays)
    assert torch.equal(arrays["agents", "features"], module(state)["agents", "features"])
