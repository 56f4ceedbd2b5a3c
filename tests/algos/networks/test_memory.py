"""Policies with hidden state: it is carried through collection, evaluation and tournaments."""

import numpy as np
import pytest
import torch
from fake_env import make_fake_env
from first_seen import FirstSeenCfg, make_show_once

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.selfplay.pool import Pool
from veca_marl.algos.selfplay.tournament import play_all
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.checkpoint import Checkpoints, Identity
from veca_marl.algos.training.evaluation import EvalCfg, Exploration, evaluate
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.progress import Budget
from veca_marl.algos.training.reporters import MemoryReporter

CPU = torch.device("cpu")
TEAMS = ("red", "blue")


def make_learners(**env):
    torch.manual_seed(0)
    cfg = PPOCfg(network=FirstSeenCfg(), learning_rate=1e-3, gamma=0.5, sequence_steps=8)
    return TeamLearners(team_specs(make_show_once(1, 0, **env)), cfg, CPU)


def first_heard(rows):
    """Return for each step ``(worlds, steps)`` what was audible in the first of its episode."""
    heard = rows["agents", "observation", "audio"][..., 0, 0, 0].clone()
    for world, begins in enumerate(rows["is_init"].squeeze(-1)):
        for step in range(1, len(begins)):
            if not begins[step]:
                heard[world, step] = heard[world, step - 1]
    return heard


@pytest.mark.parametrize("processes", [0, 2], ids=["in_process", "two_processes"])
def test_memory_lasts_for_an_episode_and_no_longer(processes):
    learners = make_learners()
    cfg = CollectCfg(processes, worlds=4 // max(processes, 1), steps=16)
    experience = Experience(make_show_once, learners.policy.copy().collect, cfg)
    experience.restart(3)
    first = experience.collect()
    batch = torch.cat([first, experience.collect()], 1)
    experience.close()
    assert batch["is_init"].sum() > 8, "worlds must begin several episodes"
    assert len(first_heard(batch).unique()) == 2, "both states must occur"
    features = batch["agents", "features"][..., 0, 0]
    torch.testing.assert_close(features, (first_heard(batch) + 3.0) / 3.0)


def test_a_policy_without_memory_leaves_the_environment_as_it_is(make_ppo):
    env = make_fake_env(2, 0)
    assert with_memory(env, make_ppo().policy) is env
    assert with_memory(env, lambda td: td) is env


def test_a_task_that_needs_memory_is_learnt(tmp_path):
    reporter = MemoryReporter()
    specs = team_specs(make_show_once(1, 0))
    trainer = Trainer(
        make_env=make_show_once,
        learners=make_learners(),
        collect=CollectCfg(0, worlds=8, steps=16),
        evaluation=EvalCfg(every_frames=10 * 128, episodes=6, worlds=3),
        budget=Budget(30 * 128),
        checkpoints=Checkpoints(tmp_path, Identity("Toy", specs), {}),
        reporters=[reporter],
        seed=0,
        progress_bar=False,
    )
    trainer.run()
    last = reporter.rows["evaluations"][-1]
    # a policy without memory knows the answer in one step of four, and is right in half the others
    assert last["return"] > 0.9 * last["length"]


def test_past_policies_with_memory_play_a_tournament(tmp_path):
    learners = make_learners(teams=TEAMS)
    pool = Pool(tmp_path)
    for team in TEAMS:
        pool.store(team, 0, learners.algorithms[team].actor.state_dict())
    env = make_show_once(3, 0, teams=TEAMS)
    members = {team: [0] for team in TEAMS}
    (match,) = play_all(env, learners.policy.copy(), pool, members, 6, 0.5, 0)
    assert match.episodes == 6


def test_evaluation_begins_without_memory():
    """Two evaluations in a row are equal: nothing is left of the first one."""
    learners = make_learners()
    env = make_show_once(3, 0)
    returns = [
        evaluate(env, learners.policy.play, 6, 1, Exploration.deterministic)["agents"].returns
        for _ in range(2)
    ]
    np.testing.assert_array_equal(*returns)
