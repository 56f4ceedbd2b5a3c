"""Intrinsic rewards in the learner: normalised, added, logged apart, resumed exactly."""

import math

import numpy as np
import pytest
import torch
from chain_env import make_chain
from fake_env import make_fake_env
from refusals import naming
from toy_dqn import ToyDQNCfg, register
from training import FRAMES, SMALL, Interrupt, read, rewards_until

from veca_marl.algos.algorithm import Algorithm
from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.intrinsic.bonus import Bonus, ReturnScale
from veca_marl.algos.intrinsic.intrinsic_reward import (
    IntrinsicCfg,
    IntrinsicReward,
    register_intrinsic,
)
from veca_marl.algos.intrinsic.predictors import ForwardModelCfg, RNDCfg
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.reporting import CsvReporter, MemoryReporter
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget

register()
CPU = torch.device("cpu")
TEAMS = ("red", "blue")


def make_env(worlds, seed):
    return make_fake_env(worlds, seed, discrete=True, teams=TEAMS, senses=("audio",))


def make_learners(intrinsic, algo=None, seed=0):
    torch.manual_seed(seed)
    cfg = algo or PPOCfg(network=SMALL)
    return TeamLearners(team_specs(make_env(1, 0)), cfg, CPU, intrinsic=intrinsic)


@pytest.fixture
def make_trainer(tmp_path):
    def make(name, intrinsic, batches=4, algo=None, reporters=None):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        learners = make_learners(intrinsic, algo)
        return Trainer(
            make_env=make_env,
            learners=learners,
            collect=CollectCfg(1, worlds=4, steps=16, processes=0),
            evaluation=EvalCfg(every_frames=2 * FRAMES, episodes=4, worlds=2),
            budget=Budget(batches * FRAMES),
            checkpoints=Checkpoints(folder / "checkpoints", Identity("Toy", learners.specs), {}),
            reporters=[CsvReporter(folder)] if reporters is None else reporters,
            seed=0,
            progress_bar=False,
        )

    return make


def rollout(learners, seed=0):
    torch.manual_seed(seed)
    with torch.no_grad():
        return make_env(4, seed).rollout(16, learners.policy.collect, break_when_any_done=False)


def test_the_scale_is_the_deviation_of_discounted_sums_over_the_ends_of_batches():
    torch.manual_seed(0)
    rewards = torch.rand(3, 20, 2)
    counted = torch.ones_like(rewards, dtype=torch.bool)
    counted[0, :, 1] = False
    scale = ReturnScale(0.9)
    for part in (slice(0, 8), slice(8, 20)):
        scale.update(rewards[:, part], counted[:, part])
    sums, values = np.zeros((3, 2)), []
    for t in range(20):
        sums = 0.9 * sums + rewards[:, t].numpy()
        values.append(sums[counted[:, t].numpy()])
    assert scale.scale == pytest.approx(np.concatenate(values).std(), rel=1e-3)


def test_the_reward_that_is_learnt_from_is_the_sum_and_the_batch_keeps_that_of_the_task():
    learners = make_learners({"red": RNDCfg(coefficient=0.5)})
    batch = rollout(learners)
    task = batch["next", "red", "reward"].clone()
    mixed, measures = learners.bonuses["red"].add(batch)
    bonus = batch["next", "red", "info", "intrinsic_return"]
    assert (bonus > 0.0).all()
    assert torch.equal(batch["next", "red", "reward"], task)
    torch.testing.assert_close(mixed["next", "red", "reward"], task + 0.5 * bonus)
    assert torch.equal(mixed["next", "blue", "reward"], batch["next", "blue", "reward"])
    assert measures.keys() == {"intrinsic_loss", "intrinsic_scale"}


class Recorded(Algorithm):
    """Keeps the rewards that it was given."""

    exact_resume = True
    measures = ()

    def __init__(self, algorithm):
        self.algorithm, self.given = algorithm, []

    @property
    def actor(self):
        return self.algorithm.actor

    def learn(self, batch):
        self.given.append(batch["next", "red", "reward"].clone())
        return {}

    def state_dict(self):
        return {}

    def load_state_dict(self, state):
        pass


def test_every_algorithm_is_given_the_sum():
    learners = make_learners({"red": ForwardModelCfg(coefficient=2.0)})
    learners.algorithms["red"] = Recorded(learners.algorithms["red"])
    batch = rollout(learners)
    measures = learners.learn(batch)
    bonus = batch["next", "red", "info", "intrinsic_return"]
    expected = batch["next", "red", "reward"] + 2.0 * bonus
    torch.testing.assert_close(learners.algorithms["red"].given[0], expected)
    assert "intrinsic_loss" in measures["red"]
    assert "intrinsic_loss" not in measures["blue"]


def test_algorithms_start_alike_with_and_without_intrinsic_rewards():
    with_bonus, without = make_learners({"red": RNDCfg()}), make_learners({})
    pairs = zip(with_bonus.policy.parameters(), without.policy.parameters(), strict=True)
    assert all(torch.equal(a, b) for a, b in pairs)


SMALL_SAC = SACCfg(
    network=SMALL, batch_size=16, replay=ReplayCfg(capacity=512, warm_up_frames=FRAMES)
)


@pytest.mark.slow
@pytest.mark.parametrize("algo", [PPOCfg(network=SMALL), SMALL_SAC], ids=["ppo", "sac"])
def test_returns_are_logged_apart(make_trainer, algo):
    memory = MemoryReporter()
    intrinsic = {"red": RNDCfg(), "blue": IntrinsicCfg()}
    trainer = make_trainer("run", intrinsic, algo=algo, reporters=[memory])
    trainer.run()
    rows = memory.rows["metrics"]
    assert all(-8.0 <= row["red/return"] <= 8.0 for row in rows)
    assert all(row["red/intrinsic_return"] > 0.0 for row in rows)
    assert all(row["red/intrinsic_loss"] >= 0.0 for row in rows)
    assert not any(name.startswith("blue/intrinsic") for row in rows for name in row)
    assert not any("intrinsic_return" in row for row in memory.rows["evaluations"])


def test_a_team_that_does_not_learn_in_a_stage_has_blank_numbers():
    learners = make_learners({team: RNDCfg() for team in TEAMS})
    learners.learning = ["red"]
    batch = rollout(learners)
    measures = learners.learn(batch)
    assert measures["red"].keys() == measures["blue"].keys()
    assert math.isnan(measures["blue"]["intrinsic_scale"])
    assert batch["next", "blue", "info", "intrinsic_return"].isnan().all()


@pytest.mark.slow
def test_resuming_is_exact(make_trainer, tmp_path):
    cfg = RNDCfg()
    whole = make_trainer("whole", {"red": cfg}, 4, ToyDQNCfg())
    whole.run()
    stopped = make_trainer("cut", {"red": cfg}, 4, ToyDQNCfg())
    stopped.reporters = [*stopped.reporters, Interrupt(3 * FRAMES)]
    with pytest.raises(KeyboardInterrupt):
        stopped.run()
    resumed = make_trainer("cut", {"red": cfg}, 4, ToyDQNCfg(), reporters=[])
    resumed.resume(resumed.checkpoints.latest())
    resumed.reporters = [CsvReporter(tmp_path / "cut", resumed.progress.frames)]
    resumed.run()
    pairs = zip(
        whole.learners.policy.parameters(), resumed.learners.policy.parameters(), strict=True
    )
    assert all(torch.equal(a, b) for a, b in pairs)
    assert read(tmp_path / "whole" / "metrics.csv") == read(tmp_path / "cut" / "metrics.csv")


def last_reward(intrinsic, batches, enough=0.3):
    """Return the mean reward of the last batch of a run in the chain, or of the first enough."""
    torch.manual_seed(0)
    algo = PPOCfg(network=SMALL, epochs=2)
    specs = team_specs(make_chain(1, 0))
    learners = TeamLearners(specs, algo, CPU, intrinsic={"agents": intrinsic})
    policy = learners.policy.copy()
    experience = Experience(
        make_chain, policy.collect, CollectCfg(1, worlds=16, steps=32, processes=0)
    )
    experience.restart(0)

    def learn():
        batch = experience.collect()
        learners.learn(batch)
        policy.take_over(learners.policy)
        experience.update_policy()
        return float(batch["next", "agents", "reward"].mean())

    rewards = rewards_until(enough, learn, batches)
    experience.close()
    return rewards[-1]


def test_a_sparse_chain_is_solved_with_novelty_and_not_without():
    """At most 0.44: 19 steps to the end, then a reward of 1 at each step."""
    assert last_reward(RNDCfg(), 16) > 0.3
    assert last_reward(IntrinsicCfg(), 16) < 0.01


def test_an_intrinsic_reward_of_a_user_is_found_by_name():
    class Constant(IntrinsicReward):
        measures = ("constant",)

        def __init__(self, team, spec, cfg, device):
            self.team = team

        def learn(self, batch):
            return torch.ones_like(batch["next", self.team, "reward"]), {"constant": 1.0}

        def state_dict(self):
            return {}

        def load_state_dict(self, state):
            pass

    class ConstantCfg(IntrinsicCfg):
        name = "constant"

    register_intrinsic("constant", ConstantCfg, Constant)
    spec = team_specs(make_env(1, 0))["red"]
    cfg = ConstantCfg("constant", coefficient=1.0)
    assert isinstance(Bonus("red", spec, cfg, CPU).source, Constant)
    with pytest.raises(ValueError, match=naming("intrinsic", "'rnf'", "rnd")):
        Bonus("red", spec, IntrinsicCfg("rnf"), CPU)
    with pytest.raises(ValueError, match=naming("intrinsic.name=rnd", "RNDCfg", "IntrinsicCfg")):
        Bonus("red", spec, IntrinsicCfg("rnd"), CPU)
