"""Behaviour cloning and DAgger learn the toy, continue exactly, and other runs start from them."""

import math
from copy import deepcopy

import pytest
import torch
from demonstrated import demonstrations_of_toy, right_action
from fake_env import FakeEnv
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type, step_mdp
from training import SMALL

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.cloning import BCCfg, DaggerCfg
from veca_marl.algos.cloning.dagger import Acts, ExpertActs
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Memory, MultisenseCfg, Parameters
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.specs import team_specs

CPU = torch.device("cpu")
FORMS = [{}, {"discrete": True}, {"hybrid": True}, {"agents": 2}]


def network(**numbers):
    return MultisenseCfg(**{**vars(SMALL), **numbers})


def make(cfg, seed=0, **env):
    torch.manual_seed(seed)
    return make_algorithm("agents", team_specs(FakeEnv(1, **env))["agents"], cfg, CPU)


def bc(**numbers):
    given = {"network": network(), "batch_size": 32, "sequence_steps": 8, "burn_in": 2}
    return BCCfg(**{**given, "learning_rate": 3e-3, "held_out": 0.25, **numbers})


def frames(count):
    return TensorDict({}, [1, count])


def score(learner, **env):
    """Return the mean reward of the most likely actions, from -1 to 1."""
    toy = with_memory(FakeEnv(16, seed=5, **env), learner.actor)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        played = toy.rollout(8, learner.actor, break_when_any_done=False)
    return float(played["next", "agents", "reward"].mean())


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("memory", list(Memory))
def test_behaviour_cloning_learns_actions_of_every_form(tmp_path, form, memory):
    learner = make(bc(network=network(memory=memory)), **form)
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8, **form))
    before = learner.learn(frames(32))
    after = [learner.learn(frames(320)) for _ in range(6)][-1]
    assert list(after) == list(learner.measures)
    assert after["imitation_loss"] < before["imitation_loss"]
    assert after["held_out_loss"] < before["held_out_loss"]
    assert score(learner, **form) > 0.9


@pytest.mark.parametrize("form", [{}, {"hybrid": True}], ids=str)
def test_a_cloned_policy_has_a_scale_to_explore_with(tmp_path, form):
    learner = make(bc(), **form)
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8, **form))
    learner.learn(frames(6400))
    policy = learner.actor.get_dist(FakeEnv(64, seed=3, **form).reset())
    if form:
        policy = policy.dists["agents", "action", "move"]
    assert policy.scale.min() > 0.15
    assert policy.scale.median() < 0.4


def test_agents_may_have_networks_of_their_own(tmp_path):
    learner = make(bc(network=network(parameters=Parameters.separate)), agents=2)
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8, agents=2))
    learner.learn(frames(1600))
    assert score(learner, agents=2) > 0.9


def test_frames_that_make_no_whole_update_count_for_the_next(tmp_path):
    learner = make(bc())
    learner.take_demonstrations(demonstrations_of_toy(tmp_path))
    assert math.isnan(learner.learn(frames(31))["imitation_loss"])
    assert learner.learn(frames(1))["epochs"] == pytest.approx(32 / 24)  # 3 of 4 episodes of 8


def test_cloning_continues_bit_for_bit(tmp_path):
    found = demonstrations_of_toy(tmp_path)
    learner, other = make(bc()), make(bc(), seed=1)
    for each in (learner, other):
        each.take_demonstrations(found)
    learner.learn(frames(80))
    other.load_state_dict(deepcopy(learner.state_dict()))  # as from a file
    results = []
    for each in (learner, other):
        torch.manual_seed(3)
        each.learn(frames(80))
        results.append(torch.cat([p.flatten() for p in each.actor.parameters()]))
    assert torch.equal(*results)


@pytest.mark.parametrize("cfg", [PPOCfg(network=SMALL), SACCfg(network=SMALL, policy_hidden=[])])
def test_other_algorithms_start_from_a_cloned_policy(tmp_path, cfg):
    learner = make(bc())
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8))
    learner.learn(frames(1600))
    stored = make(bc(), seed=2)  # as `transfer.load_learnt` does, without demonstrations
    stored.load_learnt(learner.state_dict())
    started = make(cfg, seed=3)
    started.init_from(stored)
    assert score(started) == score(learner)


KEPT = ("observation", "action", "expert_action", "memory")


def collected(learner, steps=16, seed=0, worlds=4):
    """Return a batch of the explorer, with the labels of a player that sees the state."""
    toy = with_memory(FakeEnv(worlds, seed), learner.explorer)
    base = getattr(toy, "base_env", toy)
    state, rows = toy.reset(), []
    with torch.no_grad():
        for _ in range(steps):
            state["agents", "expert_action"] = right_action(base)
            step = toy.step(learner.explorer(state))
            kept = [("agents", name) for name in KEPT if name in step["agents"].keys()]  # noqa: SIM118
            rows.append(step.select(*kept, "is_init", "next", strict=False).clone())
            state = toy.reset(step_mdp(step)) if step["next", "done"].all() else step_mdp(step)
    return torch.stack(rows, 1)


def dagger(**numbers):
    replay = ReplayCfg(capacity=1000, warm_up_frames=32)
    given = {"network": network(), "batch_size": 32, "sequence_steps": 8, "burn_in": 2}
    given |= {"replay": replay, "updates_per_frame": 0.25, "expert_frames": 128}
    return DaggerCfg(**{**given, "learning_rate": 3e-3, **numbers})


@pytest.mark.parametrize("acts", list(Acts))
@pytest.mark.parametrize("memory", list(Memory))
def test_dagger_learns_from_labels_alone(memory, acts):
    learner = make(dagger(network=network(memory=memory), acts=acts))
    measured = [learner.learn(collected(learner, seed=batch)) for batch in range(5)]
    assert list(measured[0]) == list(learner.measures)
    assert [one["expert_fraction"] for one in measured] == [1.0, 0.5, 0.0, 0.0, 0.0]
    assert score(learner) > 0.9


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_a_policy_that_acts_most_likely_collects_what_evaluations_play(form):
    base = FakeEnv(64, 0, **form)
    state = base.reset()
    state["agents", "expert_action"] = right_action(base)

    def acted(acts, kind):
        learner = make(dagger(acts=acts, expert_frames=0), **form)
        with torch.no_grad(), set_exploration_type(kind):
            return TensorDict({"action": learner.explorer(state.clone())["agents", "action"]})

    played = acted(Acts.sampled, ExplorationType.DETERMINISTIC)
    assert (acted(Acts.most_likely, ExplorationType.RANDOM) == played).all()
    assert not (acted(Acts.sampled, ExplorationType.RANDOM) == played).all()


def test_dagger_draws_a_part_of_each_update_from_demonstrations(tmp_path):
    learner = make(dagger(demonstrated=0.5))
    learner.take_demonstrations(demonstrations_of_toy(tmp_path))
    batch = collected(learner)
    batch["agents", "expert_action"] = -batch["agents", "expert_action"]  # contradicts them
    for _ in range(6):
        measured = learner.learn(batch)
    assert measured["action_error"] > 0.4  # neither can be learnt
    assert measured["imitation_loss"] > 0.1


def test_the_expert_acts_in_a_fraction_of_worlds_and_steps_and_only_while_sampling():
    torch.manual_seed(0)
    module = ExpertActs({("a", "action"): ("a", "expert_action")})
    module.fraction.fill_(0.25)
    zeros = torch.zeros(4000, 2, 3)
    state = TensorDict({"a": {"action": zeros, "expert_action": torch.ones(4000, 2, 3)}}, [4000])
    replaced = module(state.clone())["a", "action"]
    assert (replaced.flatten(1).std(1) == 0.0).all()  # a whole world at once
    assert float(replaced.mean()) == pytest.approx(0.25, abs=0.04)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        assert not module(state.clone())["a", "action"].any()


def ppo_batch(learner):
    with torch.no_grad():
        return FakeEnv(4, 0).rollout(16, learner.explorer, break_when_any_done=False)


def test_ppo_imitates_with_a_weight_that_falls_to_zero(tmp_path):
    cfg = PPOCfg(network=SMALL)
    cfg.imitation.frames = 128
    learner, plain = make(cfg), make(cfg)
    learner.take_demonstrations(demonstrations_of_toy(tmp_path))
    weights = [learner.learn(ppo_batch(learner))["imitation_weight"] for _ in range(3)]
    assert weights == pytest.approx([0.3, 0.15, 0.0])
    assert "imitation_weight" not in plain.learn(ppo_batch(plain))
    assert learner.state_dict()["imitation"] == {"frames": 192}
    assert "imitation" not in plain.state_dict()


def test_ppo_without_demonstrations_is_unchanged_by_the_numbers_of_imitation(tmp_path):
    other = PPOCfg(network=SMALL)
    other.imitation.coefficient = 9.0
    results = []
    for cfg in (PPOCfg(network=SMALL), other):
        learner = make(cfg)
        learner.learn(ppo_batch(learner))
        results.append(torch.cat([p.flatten() for p in learner.actor.parameters()]))
    assert torch.equal(*results)


@pytest.mark.parametrize("memory", list(Memory))
def test_the_replay_buffer_of_sac_begins_with_whole_episodes(tmp_path, memory):
    replay = ReplayCfg(capacity=64, warm_up_frames=16)
    cfg = SACCfg(network=network(memory=memory), replay=replay, batch_size=16, sequence_steps=4)
    learner = make(cfg)
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8))
    assert len(learner.replay) == 27  # three episodes of 9 rows in half of the buffer
    assert learner.replay.ready
    toy = with_memory(FakeEnv(4, 0), learner.explorer)
    with torch.no_grad():
        batch = toy.rollout(4, learner.explorer, break_when_any_done=False)
    measured = learner.learn(batch)
    assert list(measured) == list(learner.measures)
    assert measured["updates"] == 2.0
    assert math.isfinite(measured["imitation_loss"])


def test_sac_that_continues_begins_with_demonstrations_again(tmp_path):
    cfg = SACCfg(network=SMALL, replay=ReplayCfg(capacity=64, warm_up_frames=16))
    found = demonstrations_of_toy(tmp_path, 8)
    learner, other = make(cfg), make(cfg)
    for each in (learner, other):
        each.take_demonstrations(found)
    other.load_state_dict(learner.state_dict())
    assert len(other.replay) == len(learner.replay) == 27


WRONG = [
    {"learning_rate": 0.0},
    {"batch_size": 0},
    {"burn_in": -1},
    {"least_scale": math.inf},
    {"network": network(memory=Memory.gru), "batch_size": 30},
]


@pytest.mark.parametrize("numbers", WRONG, ids=str)
@pytest.mark.parametrize("cfg", [BCCfg, DaggerCfg])
def test_impossible_numbers_are_refused(cfg, numbers):
    with pytest.raises(ValueError, match=r"algo\."):
        cfg(**{"network": SMALL, "sequence_steps": 8, **numbers})


def test_an_impossible_fraction_is_refused():
    for cfg, name in ((BCCfg, "held_out"), (DaggerCfg, "demonstrated"), (SACCfg, "demonstrated")):
        with pytest.raises(ValueError, match=name):
            cfg(network=SMALL, **{name: 1.0})
