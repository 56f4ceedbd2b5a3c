"""What the interface of an algorithm promises, for each one: on-policy, with and without replay."""

from dataclasses import replace

import pytest
import torch
from fake_env import make_fake_env
from refusals import naming
from toy_dqn import ForgetfulDQN, ForgetfulDQNCfg, ToyDQN, ToyDQNCfg, register
from training import FRAMES, SMALL, Interrupt, read

from veca_marl.algos.algorithm import (
    ALGORITHMS,
    AlgorithmCfg,
    make_algorithm,
    register_algorithm,
)
from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.networks.action_values import ActionValuesCfg
from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.reporting import CsvReporter, MemoryReporter
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.selfplay import Pool, SelfPlay, SelfPlayCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget
from veca_marl.algos.transfer import load_actor, load_learnt

register()
CPU = torch.device("cpu")
ALL = {
    "ppo": PPOCfg(network=SMALL),
    "sac": SACCfg(
        network=SMALL,
        critic=ActionValuesCfg(hidden=[32]),
        policy_hidden=[],
        replay=ReplayCfg(4096, warm_up_frames=64),
        learning_rate=1e-2,
        updates_per_frame=0.06,
    ),
    "toy_dqn": ToyDQNCfg(),
    "forgetful_dqn": ForgetfulDQNCfg(),
}
every_algorithm = pytest.mark.parametrize("cfg", ALL.values(), ids=ALL.keys())
SAC_WITH_REPLAY = replace(ALL["sac"], replay=ReplayCfg(300, 64, in_checkpoint=True))


def specs_of(teams=("agents",)):
    return team_specs(make_fake_env(1, 0, discrete=True, teams=teams, senses=("audio",)))


@pytest.fixture
def make_trainer(tmp_path):
    def make(name, cfg, batches, own=None, teams=("agents",), reporters=()):
        def make_env(worlds, seed):
            return make_fake_env(worlds, seed, discrete=True, teams=teams, senses=("audio",))

        torch.manual_seed(0)
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        specs = specs_of(teams)
        return Trainer(
            make_env=make_env,
            learners=TeamLearners(specs, cfg, CPU, own),
            collect=CollectCfg(1, worlds=4, steps=16, processes=0),
            evaluation=EvalCfg(every_frames=2 * FRAMES, episodes=4, worlds=2),
            budget=Budget(batches * FRAMES),
            checkpoints=Checkpoints(folder / "checkpoints", Identity("Toy", specs), {}),
            reporters=reporters or [CsvReporter(folder)],
            seed=0,
            progress_bar=False,
        )

    return make


def state_of(trainer):
    return {name: array.clone() for name, array in trainer.learners.policy.state_dict().items()}


def equal(one, other):
    return all(torch.equal(one[name], other[name]) for name in one)


@every_algorithm
def test_it_learns_and_is_evaluated(make_trainer, cfg):
    reporter = MemoryReporter()
    trainer = make_trainer("run", cfg, 24, reporters=[reporter])
    (line,) = trainer.run()
    assert line.startswith("agents: return of policy")
    policy = [row for row in reporter.rows["evaluations"] if row["player"] == "policy"]
    assert policy[-1]["return"] > 6.0  # of 8
    algorithm = trainer.learners.algorithms["agents"]
    for row in reporter.rows["metrics"]:
        assert all(row[f"agents/{name}"] == row[f"agents/{name}"] for name in algorithm.measures)


@pytest.mark.parametrize("cfg", [*ALL.values(), SAC_WITH_REPLAY], ids=[*ALL, "sac_with_replay"])
def test_resuming_is_exact_if_the_algorithm_says_so(make_trainer, tmp_path, cfg):
    whole = make_trainer("whole", cfg, 6)
    whole.run()
    stopped = make_trainer("cut", cfg, 6, reporters=[CsvReporter(tmp_path / "cut"), Interrupt(320)])
    with pytest.raises(KeyboardInterrupt):
        stopped.run()
    resumed = make_trainer("cut", cfg, 6, reporters=[MemoryReporter()])
    resumed.resume(resumed.checkpoints.latest())
    assert resumed.progress.frames == 4 * FRAMES
    resumed.reporters = [CsvReporter(tmp_path / "cut", resumed.progress.frames)]
    notes = " ".join(resumed.run())
    exact = resumed.learners.exact_resume
    assert equal(state_of(whole), state_of(resumed)) is exact
    assert ("does not continue bit for bit" in notes) is not exact
    if exact:
        assert read(tmp_path / "whole" / "metrics.csv") == read(tmp_path / "cut" / "metrics.csv")


@every_algorithm
def test_a_file_for_playing_gives_the_same_actions(make_trainer, tmp_path, cfg):
    trainer = make_trainer("run", cfg, 4)
    trainer.run()
    actor = load_actor(tmp_path / "run", "agents", specs_of()["agents"])
    assert not any(p.requires_grad for p in actor.parameters())
    state = make_fake_env(4, 1, discrete=True, senses=("audio",)).reset()
    mine, other = trainer.policy.play(state.clone()), actor(state.clone())
    assert torch.equal(mine["agents", "action"], other["agents", "action"])


@every_algorithm
def test_a_run_starts_from_what_another_one_learnt(make_trainer, tmp_path, cfg):
    trainer = make_trainer("run", cfg, 4)
    trainer.run()
    stored = load_learnt(tmp_path / "run", "agents", specs_of()["agents"])
    fresh = make_algorithm("agents", specs_of()["agents"], cfg, CPU)
    fresh.init_from(stored)
    assert equal(fresh.actor.state_dict(), trainer.learners.algorithms["agents"].actor.state_dict())


def test_buffers_of_exploration_reach_the_workers():
    """The switch of the random warm-up is a buffer, not a parameter."""

    def make_env(worlds, seed):
        return make_fake_env(worlds, seed, discrete=True, senses=("audio",))

    learners = TeamLearners(specs_of(), ToyDQNCfg(epsilon=0.0), CPU)
    policy = learners.policy.copy()
    experience = Experience(
        make_env, policy.collect, CollectCfg(2, worlds=2, steps=16, processes=2)
    )
    greedy = []
    for active in (True, False):
        learners.algorithms["agents"].warm_up.active.fill_(active)
        policy.take_over(learners.policy)
        experience.restart(0)
        experience.update_policy()
        batch = experience.collect()
        best = batch["agents", "action_value"].argmax(-1)
        greedy.append(bool((batch["agents", "action"] == best).all()))
    experience.close()
    assert greedy == [False, True]


def test_teams_may_learn_by_different_algorithms(make_trainer):
    reporter = MemoryReporter()
    trainer = make_trainer(
        "run", ALL["ppo"], 2, {"blue": ToyDQNCfg()}, ("red", "blue"), reporters=[reporter]
    )
    lines = trainer.run()
    assert isinstance(trainer.learners.algorithms["red"], PPO)
    assert isinstance(trainer.learners.algorithms["blue"], ToyDQN)
    row = reporter.rows["metrics"][-1]
    assert {"red/kl", "blue/td_error"} <= row.keys()
    notes = ["no best.pt", "no comparison with random actions"]
    assert [line.split(":")[0] for line in lines] == notes


@pytest.mark.parametrize("name", ["sac", "toy_dqn"])
def test_self_play_is_for_every_algorithm(make_trainer, tmp_path, name):
    trainer = make_trainer("run", ALL[name], 6, teams=("red", "blue"))
    pool = Pool(tmp_path / "run" / "pool")
    trainer.matchmaking = SelfPlay(SelfPlayCfg(["red", "blue"], 0.0), trainer.learners, pool, 0)
    trainer.run()
    assert pool.members("red") == [0, 2 * FRAMES, 6 * FRAMES]
    assert pool.members("blue") == [0, 4 * FRAMES]


def test_algorithms_are_found_by_name():
    assert ALGORITHMS["ppo"].factory is PPO
    spec = specs_of()["agents"]
    assert isinstance(make_algorithm("agents", spec, ForgetfulDQNCfg(), CPU), ForgetfulDQN)
    with pytest.raises(ValueError, match=naming("algorithm", "'pop'", "ppo")):
        make_algorithm("agents", spec, AlgorithmCfg("pop"), CPU)
    with pytest.raises(ValueError, match=naming("algo.name=toy_dqn", "ToyDQNCfg", "PPOCfg")):
        make_algorithm("agents", spec, PPOCfg("toy_dqn"), CPU)


def test_a_name_is_given_once():
    with pytest.raises(ValueError, match=naming("'ppo'", "PPO", "ToyDQN")):
        register_algorithm("ppo", PPOCfg, ToyDQN)
    with pytest.raises(ValueError, match=naming("ToyDQNCfg.name", "'toy_dqn'", "'other'")):
        register_algorithm("other", ToyDQNCfg, ToyDQN)
