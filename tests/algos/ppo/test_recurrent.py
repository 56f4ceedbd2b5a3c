"""PPO of networks with hidden state: sequences, values after a cut, a task that needs memory."""

from copy import deepcopy
from dataclasses import replace

import pytest
import torch
from cue import make_cue
from first_seen import make_show_once
from gae import gae_by_hand
from refusals import naming
from torchrl.modules import set_recurrent_mode
from training import SMALL

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.evaluation.evaluate import Exploration, evaluate
from veca_marl.algos.networks.encoders import Precision
from veca_marl.algos.networks.multisense import Critic, Memory, Parameters
from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.ppo.advantages import advantages
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners

CPU = torch.device("cpu")
GRU = replace(SMALL, memory=Memory.gru, memory_features=16, precision=Precision.float32)
STEPS, WORLDS = 16, 6


def collected(network=GRU, agents=2, **numbers):
    """Return a PPO and its second batch, whose first steps are within episodes."""
    torch.manual_seed(0)
    env = {"agents": agents, "horizons": (5, 7, 30)}
    cfg = PPOCfg(network=network, sequence_steps=8, **numbers)
    ppo = PPO("agents", team_specs(make_show_once(1, 0, **env))["agents"], cfg, CPU)
    experience = Experience(
        lambda worlds, seed: make_show_once(worlds, seed, **env),
        deepcopy(ppo.actor),
        CollectCfg(1, WORLDS, STEPS, processes=0),
    )
    experience.restart(0)
    experience.collect()
    batch = experience.collect()
    experience.close()
    return ppo, batch


@pytest.fixture(params=["shared", "separate", "central"])
def recurrent(request):
    choices = {
        "shared": GRU,
        "separate": replace(GRU, parameters=Parameters.separate),
        "central": replace(GRU, critic=Critic.central),
        "shortcut": replace(GRU, memory=Memory.gru_shortcut),
    }
    return collected(choices[request.param])


def test_features_of_a_stored_sequence_equal_the_collected_ones(recurrent):
    ppo, batch = recurrent
    rows = ppo.prepare(batch)
    assert rows.batch_size == (WORLDS * STEPS // 8, 8)
    assert rows["is_init"][:, 1:].any(), "episodes must begin inside a sequence"
    assert rows["agents", "memory", "hidden"][:, 0].abs().max() > 0.0
    within = ~rows["is_init"].squeeze(-1)
    within[:, 0] = False
    rows["agents", "memory", "hidden"][within] = 9.0  # only the first of an episode is read
    with torch.no_grad(), set_recurrent_mode(True):
        again = ppo.network.encoder(rows)["agents", "features"]
    features = batch["agents", "features"].reshape(again.shape)
    torch.testing.assert_close(again, features, rtol=1e-4, atol=1e-5)
    assert ppo.step(ppo.prepare(batch))["kl"] == pytest.approx(0.0, abs=1e-6)


def test_values_after_a_cut_use_the_state_at_the_cut(recurrent):
    """Every value by the plain way: one step after another from the stored first state."""
    ppo, batch = recurrent
    found = advantages(ppo.network, batch, "agents", 0.99, 0.95)
    network = ppo.network
    with torch.no_grad():
        value = network.critic(network.encoder(batch.clone()))["agents", "state_value"]
        after = batch["next"].clone()
        after["agents", "memory", "hidden"] = batch["agents", "features"]
        after["is_init"] = torch.zeros_like(after["is_init"])
        following = network.critic(network.encoder(after))["agents", "state_value"]
    team = batch["next", "agents"]
    expected = gae_by_hand(value, following, team["reward"], team["done"], team["terminated"])
    assert batch["next", "done"][:, :-1].any()
    torch.testing.assert_close(found["advantage"], expected, rtol=1e-4, atol=1e-5)


def test_minibatches_have_as_many_frames_as_without_memory(monkeypatch):
    seen = {}
    for network in (SMALL, GRU):
        ppo, batch = collected(network, agents=1)
        step, sizes = ppo.step, []
        monkeypatch.setattr(ppo, "step", lambda rows, f=step, s=sizes: (s.append(rows), f(rows))[1])
        ppo.learn(batch)
        seen[network.memory] = [rows.numel() for rows in sizes]
    assert seen[Memory.gru] == seen[Memory.none] == [WORLDS * STEPS // 4] * 16


def test_gradients_flow_through_time_within_a_sequence():
    ppo, batch = collected(agents=1)
    rows = ppo.prepare(batch)
    audio = rows["agents", "observation", "audio"].requires_grad_()
    ppo.loss(rows)["loss_objective"].backward()
    sequence = (~rows["is_init"][:, 1:].any((1, 2))).nonzero()[0, 0]
    assert audio.grad[sequence, 0].abs().max() > 0.0
    audio.grad = None
    with set_recurrent_mode(True):
        ppo.network.encoder(rows)["agents", "features"][sequence, -1].sum().backward()
    assert audio.grad[sequence, 0].abs().max() > 0.0


def test_explained_variance_is_over_all_steps():
    ppo, batch = collected(agents=1)
    rows = ppo.prepare(batch)
    with torch.no_grad(), set_recurrent_mode(True):
        value = ppo.network.critic(ppo.network.encoder(rows.clone()))["agents", "state_value"]
    target = rows["agents", "value_target"]
    expected = 1.0 - (target - value).var(correction=0) / target.var(correction=0)
    assert ppo.step(rows)["explained_variance"] == pytest.approx(expected.item(), rel=1e-3)


def trained_return(memory, iterations):
    torch.manual_seed(0)
    network = replace(SMALL, trunk_features=16, memory=memory, memory_features=16)
    numbers = PPOCfg(network=network, sequence_steps=16, learning_rate=1e-3, max_learning_rate=3e-3)
    learners = TeamLearners(team_specs(make_cue(1, 0)), numbers, CPU)
    player = learners.policy.copy()
    experience = Experience(make_cue, player.collect, CollectCfg(1, 16, 16, processes=0))
    experience.restart(0)
    for _ in range(iterations):
        learners.learn(experience.collect())
        player.take_over(learners.policy)
        experience.update_policy()
    experience.close()
    scores = evaluate(make_cue(16, 0), player.play, 32, 1, Exploration.deterministic)
    return scores["agents"].returns.mean()


def test_a_task_that_needs_memory_is_learnt_with_a_gru():
    assert trained_return(Memory.gru, 14) > 0.9


@pytest.mark.slow
def test_a_task_that_needs_memory_is_not_learnt_without():
    assert abs(trained_return(Memory.none, 14)) < 0.3


@pytest.mark.parametrize(
    ("numbers", "worlds", "steps", "parts"),
    [
        ({"sequence_steps": 0}, 8, 128, ("algo.sequence_steps", " 0")),
        ({"sequence_steps": 48}, 8, 128, ("sequence_steps=48", "collect.steps", "128")),
        ({"sequence_steps": 32}, 1, 64, (" 2 ", " 32 ", "algo.minibatches=4")),
        ({"sequence_steps": 1}, 1, 7, ("algo.minibatches=4", " 7")),
    ],
)
def test_sequences_that_do_not_fit_a_batch_are_refused(numbers, worlds, steps, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        PPOCfg(network=GRU, **numbers).check_batch(worlds, steps)


def test_without_memory_the_length_of_sequences_does_not_matter():
    PPOCfg(network=SMALL, sequence_steps=48).check_batch(8, 128)


def test_minibatches_of_one_frame_are_refused():
    """One advantage has no standard deviation, by which advantages are divided."""
    PPOCfg(network=SMALL, minibatches=4).check_batch(1, 8)
    with pytest.raises(ValueError, match=naming("algo.minibatches=4", " 7")):
        PPOCfg(network=SMALL, minibatches=4).check_batch(1, 7)


def test_a_batch_of_other_steps_is_refused():
    ppo, batch = collected()
    with pytest.raises(ValueError, match=naming("algo.sequence_steps", "collect.steps", "15")):
        ppo.learn(batch[:, :15])
