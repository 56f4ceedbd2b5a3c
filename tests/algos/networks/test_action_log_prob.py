"""The log-probability of an action of one part or several, as algorithms of plug-ins use it."""

import pytest
import torch
from torchrl.envs import ExplorationType, set_exploration_type

import veca_marl
from veca_marl.extend import MultisenseCfg, action_log_prob, make_network, team_specs


@pytest.mark.parametrize("body", ["walker", "walker_discrete", "walker_voice"])
def test_parts_of_an_action_are_added(body):
    env = veca_marl.make("KickTheBall", body=body, worlds=2, senses={"vision": "blind"}, seed=0)
    network = make_network("agents", team_specs(env)["agents"], MultisenseCfg())
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = env.rollout(3, policy=network.actor, break_when_any_done=False)
        log_prob = action_log_prob(network.actor.get_dist(batch), batch, "agents")
    written = [
        value
        for key, value in batch["agents"].items(include_nested=True, leaves_only=True)
        if str(key[-1] if isinstance(key, tuple) else key).endswith("_log_prob")
    ]
    assert len(written) == (2 if body == "walker_voice" else 1)
    assert log_prob.shape == (2, 3, 1)
    torch.testing.assert_close(log_prob, sum(written), rtol=1e-3, atol=1e-3)
    env.close()
