"""Policies with hidden state: carried through collection, evaluation, video and tournaments."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from composed import compose
from fake_env import make_fake_env
from first_seen import FirstSeenCfg, make_show_once
from training import FRAMES, SMALL, Interrupt

from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.evaluation.evaluate import EvalCfg, Exploration, RandomTeams, evaluate
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Memory
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.selfplay import Pool, play_all
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.video import record_episode

CPU = torch.device("cpu")
GRU = replace(SMALL, memory=Memory.gru, memory_features=16)
TEAMS = ("red", "blue")


def make_learners(network=None, **env):
    torch.manual_seed(0)
    cfg = PPOCfg(network=network or FirstSeenCfg(), sequence_steps=8)
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
    cfg = CollectCfg(2, worlds=2, processes=processes, steps=16)
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


def make_trainer(folder, reporters=()):
    torch.manual_seed(0)
    specs = team_specs(make_show_once(1, 0))
    return Trainer(
        make_env=make_show_once,
        learners=TeamLearners(specs, PPOCfg(network=GRU, sequence_steps=8), CPU),
        collect=CollectCfg(1, worlds=4, steps=16, processes=0),
        evaluation=EvalCfg(every_frames=FRAMES, episodes=2, worlds=2),
        budget=Budget(3 * FRAMES),
        checkpoints=Checkpoints(folder, Identity("Toy", specs), {}),
        reporters=reporters,
        seed=0,
        progress_bar=False,
    )


@pytest.mark.slow
def test_a_resumed_run_with_memory_equals_one_without_interruption(tmp_path):
    whole = make_trainer(tmp_path / "whole")
    whole.run()
    with pytest.raises(KeyboardInterrupt):
        make_trainer(tmp_path / "other", [Interrupt(2 * FRAMES)]).run()
    resumed = make_trainer(tmp_path / "other")
    resumed.resume(resumed.checkpoints.latest())
    assert resumed.progress.frames == FRAMES
    resumed.run()
    pairs = zip(
        whole.learners.policy.parameters(), resumed.learners.policy.parameters(), strict=True
    )
    assert all(torch.equal(one, other) for one, other in pairs)


def test_a_policy_with_memory_is_recorded(tmp_path):
    """The video is of a world alone: one game, the state of which is carried there too."""
    game = compose(["+task=KickTheBall", "task.max_seconds=0.2", "senses/vision=blind"]).game
    env = VecaEnv(game, 1, 0)
    learners = TeamLearners(team_specs(env), PPOCfg(network=GRU), CPU)
    env.close()
    states = []
    learners.policy.play.register_forward_pre_hook(
        lambda module, args: states.append(args[0]["agents", "memory", "hidden"].clone())
    )
    record_episode(tmp_path / "video.mp4", game, learners.policy.play, 0)
    assert not states[0].any()
    assert len(states) == 5
    assert all(state.any() for state in states[1:])


def test_past_policies_with_memory_play_a_tournament(tmp_path):
    learners = make_learners(GRU, teams=TEAMS)
    pool = Pool(tmp_path)
    for team in TEAMS:
        pool.store(team, 0, learners.algorithms[team].actor.state_dict())
    env = make_show_once(3, 0, teams=TEAMS)
    members = {team: [0] for team in TEAMS}
    (match,) = play_all(env, learners.policy.copy(), pool, members, 6, 0.5, 0)
    assert match.episodes == 6


def test_a_frozen_policy_with_memory_plays_against_a_learner_without():
    specs = team_specs(make_show_once(1, 0, teams=TEAMS))
    frozen = {"blue": make_learners(GRU, teams=TEAMS).algorithms["blue"].actor}
    learners = TeamLearners(specs, PPOCfg(network=SMALL), CPU, frozen=frozen)
    experience = Experience(
        lambda worlds, seed: make_show_once(worlds, seed, teams=TEAMS),
        learners.policy.copy().collect,
        CollectCfg(1, worlds=4, steps=16, processes=0),
    )
    experience.restart(0)
    batch = experience.collect()
    experience.close()
    assert set(learners.learn(batch)) == {"red"}
    later = ~batch["is_init"].squeeze(-1)
    assert batch["blue", "memory", "hidden"][later].any(-1).all()
    baseline = RandomTeams(make_show_once(2, 0, teams=TEAMS), ["red"], list(frozen.values()))
    env = make_show_once(2, 0, teams=TEAMS)
    scores = evaluate(env, baseline, 4, 1, Exploration.deterministic)
    assert len(scores["red"].returns) == 4


def test_evaluation_begins_without_memory():
    """Two evaluations in a row are equal: nothing is left of the first one."""
    learners = make_learners(GRU)
    env = make_show_once(3, 0)
    returns = [
        evaluate(env, learners.policy.play, 6, 1, Exploration.deterministic)["agents"].returns
        for _ in range(2)
    ]
    np.testing.assert_array_equal(*returns)
