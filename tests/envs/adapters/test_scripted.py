"""Experts as policies of an environment."""

import pytest

from veca_marl.api import make
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy


@pytest.mark.slow
@pytest.mark.parametrize("body", ["walker", "walker_discrete"])
def test_the_expert_kicks_in_most_worlds(body):
    env = make("KickTheBall", worlds=8, body=body, senses={"vision": "blind"}, seed=1)
    played = env.rollout(300, policy=ExpertPolicy(env))
    kicks = played["next", "agents", "info", "kick"].sum(1).flatten()
    env.close()
    assert played.shape == (8, 300)
    assert (kicks >= 1).sum() >= 3


def test_the_expert_acts_in_each_world_on_its_own_observation():
    together = make("KickTheBall", worlds=2, senses={"vision": "blind"}, seed=1)
    alone = make("KickTheBall", worlds=1, senses={"vision": "blind"}, seed=1)
    both = together.rollout(80, policy=ExpertPolicy(together))["agents", "action"]
    first = alone.rollout(80, policy=ExpertPolicy(alone))["agents", "action"]
    assert (both[0] == first[0]).all()
    assert not (both[0] == both[1]).all()
    together.close()
    alone.close()
