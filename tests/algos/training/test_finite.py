"""NaN and infinity end a run before they are learnt from."""

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from fake_env import FakeEnv
from killed_runs import make_trainer
from refusals import naming
from training import FRAMES

from veca_marl.algos.evaluation.evaluate import Scores
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.finite import (
    NotFiniteError,
    check_batch,
    check_scores,
    check_state,
    warn_of_ranges,
)

WORLD, STEP = 2, 5


def batch(**env):
    return FakeEnv(4, agents=2, **env).rollout(8, break_when_any_done=False)


def set_value(data, key, value):
    data[key][WORLD, STEP, 1, ...] = value


@pytest.mark.parametrize(
    ("key", "value", "parts"),
    [
        (("next", "agents", "reward"), math.nan, ("reward", "nan")),
        (("next", "agents", "info", "right"), math.inf, ("'right'", " inf")),
        (("agents", "observation", "audio"), -math.inf, ("'audio'", "-inf")),
        (("next", "agents", "observation", "audio"), math.nan, ("next", "'audio'", "nan")),
        (("agents", "action"), math.nan, ("'action'", "nan")),
    ],
)
def test_a_value_is_named_with_team_world_and_step(key, value, parts):
    data = batch()
    check_batch(data, ["agents"], 0)
    set_value(data, key, value)
    where = ("'agents'", "world 2", "step 5", " 640 ")
    with pytest.raises(NotFiniteError, match=naming(*parts, *where)):
        check_batch(data, ["agents"], 640)


def test_observations_outside_their_range_are_named_in_a_warning(caplog):
    data = batch()
    specs = team_specs(FakeEnv(4, agents=2))
    layout = replace(specs["agents"].observations["audio"], low=-1.0, high=1.0)
    specs = {"agents": replace(specs["agents"], observations={"audio": layout})}
    data["agents", "observation", "audio"].clamp_(-1.0, 1.0)
    warn_of_ranges(data, specs, 640)
    assert not caplog.records
    set_value(data, ("agents", "observation", "audio"), 7.0)
    warn_of_ranges(data, specs, 640)
    (record,) = caplog.records
    assert re.search(naming("'agents'", "'audio'", "7", "[-1, 1]", "640"), record.getMessage())


def test_parts_of_an_action_are_named():
    data = batch(hybrid=True)
    set_value(data, ("agents", "action", "move"), math.nan)
    with pytest.raises(NotFiniteError, match=naming("'move'", "nan")):
        check_batch(data, ["agents"], 0)


def test_the_term_is_named_before_the_reward_that_contains_it():
    data = batch()
    set_value(data, ("next", "agents", "reward"), math.nan)
    set_value(data, ("next", "agents", "info", "right"), math.nan)
    with pytest.raises(NotFiniteError, match=naming("'right'", "nan")):
        check_batch(data, ["agents"], 0)


def test_scores_and_states_are_checked():
    good = Scores(np.zeros(3), np.ones(3), {"goal": np.zeros(3)})
    check_scores({"red": good})
    bad = replace(good, terms={"goal": np.array([0.0, math.nan, 0.0])})
    with pytest.raises(NotFiniteError, match=naming("'red'", "'goal'", "nan", "episode 1")):
        check_scores({"red": bad})
    state = {"red": {"network": {"0.weight": torch.zeros(2)}, "optimizer": [{"step": 3}]}}
    check_state(state, 0)
    state["red"]["network"]["0.weight"][1] = math.nan
    with pytest.raises(NotFiniteError, match=naming("red.network.0.weight", "nan", "128")):
        check_state(state, 128)
    state["red"]["network"]["0.weight"][1] = -math.inf
    with pytest.raises(NotFiniteError, match=naming("red.network.0.weight", "-inf", "128")):
        check_state(state, 128)


def test_a_checkpoint_of_intrinsic_rewards_that_are_not_finite_is_refused(tmp_path, monkeypatch):
    trainer = make_trainer(tmp_path)
    state = {"agents": {"scale": torch.tensor(math.inf)}}
    monkeypatch.setattr(trainer.learners, "intrinsic_state", lambda: state)
    with pytest.raises(NotFiniteError, match=naming("intrinsic.agents.scale", " inf", " 0 ")):
        trainer.run()
    assert not list(tmp_path.rglob("*.pt"))


class BrokenRewards(FakeEnv):
    """The reward of world 1 is NaN in the second episode of a training stage."""

    def _step(self, td):
        out = super()._step(td)
        if self.batch_size[0] == 4 and self.episodes[1] == 1:
            out["agents", "reward"][1] = math.nan
        return out


def test_a_run_with_a_nan_reward_ends_before_it_learns_from_it(tmp_path):
    trainer = make_trainer(tmp_path)
    trainer.make_env = partial(BrokenRewards, senses=("audio",))
    before = [p.clone() for p in trainer.learners.policy.parameters()]
    with pytest.raises(NotFiniteError, match=naming("reward", "nan", "world 1", "step")):
        trainer.run()
    assert all(map(torch.equal, before, trainer.learners.policy.parameters()))
    assert trainer.progress.frames < FRAMES
    assert trainer.checkpoints.latest().name == "frames_000000000000.pt"
