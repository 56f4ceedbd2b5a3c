"""All teams together: copies of the policy, frozen teams, the best checkpoint, the baseline."""

import numpy as np
import pytest
import torch
from fake_env import FakeEnv, make_fake_env
from torch import nn
from training import FRAMES, SMALL

from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg, Exploration, RandomTeams, evaluate
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.reporting import MemoryReporter
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget

TEAMS = ("red", "blue")
CPU = torch.device("cpu")


def make_env(worlds, seed):
    return make_fake_env(worlds, seed, teams=TEAMS, senses=("audio",))


class Always(nn.Module):
    """Acts with one sign."""

    in_keys, out_keys = (("blue", "observation", "audio"),), (("blue", "action"),)

    def __init__(self, sign):
        super().__init__()
        self.sign = sign
        self.unused = nn.Parameter(torch.zeros(()), requires_grad=False)

    def forward(self, td):
        lead = td["blue", "observation", "audio"].shape[:2]
        return td.set(("blue", "action"), torch.full((*lead, 2), self.sign))


@pytest.fixture
def make_trainer(tmp_path):
    def make(frozen=None, batches=4):
        torch.manual_seed(0)
        specs = team_specs(make_env(1, 0))
        reporter = MemoryReporter()
        trainer = Trainer(
            make_env=make_env,
            learners=TeamLearners(specs, PPOCfg(network=SMALL), CPU, frozen=frozen),
            collect=CollectCfg(1, worlds=4, steps=16, processes=0),
            evaluation=EvalCfg(every_frames=FRAMES, episodes=4, final_episodes=4, worlds=2),
            budget=Budget(batches * FRAMES),
            checkpoints=Checkpoints(tmp_path, Identity("Toy", specs), {}, keep_last=9),
            reporters=[reporter],
            seed=0,
            progress_bar=False,
        )
        trainer.rows = reporter.rows
        return trainer

    return make


def test_a_copy_takes_over_parameters_and_buffers(make_ppo):
    ppo = make_ppo()
    ppo.algorithms["agents"].network.encoder.register_buffer("statistic", torch.zeros(3))
    copy = ppo.policy.copy()
    with torch.no_grad():
        for tensor in [*ppo.policy.parameters(), *ppo.policy.buffers()]:
            tensor.add_(1.0)
    copy.take_over(ppo.policy)
    mine, other = ppo.policy.actors.state_dict(), copy.actors.state_dict()
    assert any(name.endswith("statistic") for name in mine)
    assert all(torch.equal(mine[name], other[name]) for name in mine)
    assert not any(mine[name].data_ptr() == other[name].data_ptr() for name in mine)


def test_the_baseline_plays_against_the_frozen_opponents():
    env, frozen = make_env(3, 0), Always(1.0)
    baseline = RandomTeams(env, ["red"], [frozen])
    state = baseline(env.reset())
    assert (state["blue", "action"] == 1.0).all()
    assert not (state["red", "action"].abs() == 1.0).any()


def test_policy_and_baseline_play_against_the_same_opponents(make_trainer):
    frozen = Always(1.0)
    trainer = make_trainer({"blue": frozen})
    (line,) = trainer.run()
    assert line.startswith("red: ")
    players = {}
    for row in trainer.rows["evaluations"]:
        if row["team"] == "blue":
            players.setdefault(row["player"], []).append(row["return"])
    # the frozen team acts in every step as it does against the policy: its returns are equal
    assert set(players["policy"]) == set(players["random"])


def test_one_learning_team_has_a_best_checkpoint_by_its_own_return(make_trainer, tmp_path):
    trainer = make_trainer({"blue": Always(1.0)})
    trainer.run()
    red = [
        row
        for row in trainer.rows["evaluations"]
        if row["team"] == "red" and row["player"] == "policy"
    ]
    best = torch.load(tmp_path / "best.pt", weights_only=True)["state"]["progress"]
    assert best["best_return"] == max(row["return"] for row in red)
    returns = [row["return"] for row in red]
    assert best["frames"] == red[int(np.argmax(returns))]["frames"]


def test_several_learning_teams_keep_no_best_checkpoint_and_report_it(make_trainer, tmp_path):
    lines = make_trainer().run()
    assert not (tmp_path / "best.pt").exists()
    assert (tmp_path / f"frames_{4 * FRAMES:012d}.pt").exists()
    assert any(line.startswith("no best.pt: several teams learn") for line in lines)


def test_two_policies_are_evaluated_in_equal_episodes():
    """Episode k of world w starts alike for every policy, whatever was drawn before."""

    def starts(policy):
        env, seen = FakeEnv(2, horizon=4), []

        def note(td):
            seen.append(td["agents", "observation", "audio"][..., 0, 0, 0].clone())
            return policy(td)

        evaluate(env, note, 6, 3, Exploration.stochastic)
        return torch.stack(seen)[::4]  # each fourth step begins an episode

    def random(td):
        lead = td["agents", "observation", "audio"].shape[:2]
        return td.set(("agents", "action"), torch.rand(*lead, 2) * 2.0 - 1.0)

    def idle(td):
        lead = td["agents", "observation", "audio"].shape[:2]
        return td.set(("agents", "action"), torch.ones(*lead, 2))

    assert torch.equal(starts(random), starts(idle))
