import numpy as np
import pytest
import torch
from fake_env import FakeEnv
from refusals import naming
from scipy import stats
from tensordict import TensorDict

from veca_marl.algos.evaluation.comparison import (
    comparison_line,
    interval,
    paired_difference,
    score_rows,
)
from veca_marl.algos.evaluation.episodes import EpisodeTally, TrainingEpisodes
from veca_marl.algos.evaluation.evaluate import (
    EvalCfg,
    Exploration,
    Scores,
    evaluate,
    joined_scores,
    random_policy,
)

DETERMINISTIC, STOCHASTIC = Exploration.deterministic, Exploration.stochastic


def oracle(td):
    """Act with the sign of the state that the image shows."""
    bright = td["agents", "observation", "vision"].float().mean((-1, -2, -3, -4)) > 100
    sign = bright.float() * 2 - 1
    return td.set(("agents", "action"), sign.unsqueeze(-1).expand(*sign.shape, 2).clone())


def test_scores_are_sums_over_whole_episodes():
    scores = evaluate(FakeEnv(3, horizon=6), oracle, 7, 0, DETERMINISTIC)["agents"]
    assert scores.returns.shape == (7,)
    assert (scores.returns == 6).all()
    assert (scores.lengths == 6).all()
    assert (scores.terms["right"] == 6).all()


class Drifting(FakeEnv):
    """The reward depends on the number of the episode through its states."""

    def _step(self, td):
        out = super()._step(td)
        out["agents", "reward"] += torch.from_numpy(self.state).unsqueeze(-1) * 1.0
        return out


@pytest.mark.parametrize("worlds", [1, 3, 4, 8])
def test_the_result_does_not_depend_on_the_number_of_worlds(worlds):
    whole = evaluate(Drifting(7), oracle, 7, 5, DETERMINISTIC)["agents"]
    split = evaluate(Drifting(worlds), oracle, 7, 5, DETERMINISTIC)["agents"]
    assert len(set(whole.returns)) > 2
    np.testing.assert_array_equal(whole.returns, split.returns)
    part = evaluate(Drifting(worlds), oracle, 3, 5, DETERMINISTIC, first=4)["agents"]
    np.testing.assert_array_equal(whole.returns[4:], part.returns)


def test_what_shows_the_progress_is_told_of_every_episode_once():
    counts = []
    evaluate(FakeEnv(3, horizon=6), oracle, 7, 0, DETERMINISTIC, played=counts.append)
    assert counts == [3, 3, 1]


def test_the_result_depends_on_the_seed_alone():
    def play(seed, used):
        env = FakeEnv(4)
        if used:
            env.rollout(5)
        return evaluate(env, random_policy(env), 8, seed, STOCHASTIC)["agents"].returns

    np.testing.assert_array_equal(play(1, used=False), play(1, used=True))
    assert (play(1, used=False) != play(2, used=False)).any()


def test_random_actions_have_a_mean_return_of_zero():
    env = FakeEnv(8, horizon=8)
    returns = evaluate(env, random_policy(env), 200, 0, STOCHASTIC)["agents"].returns
    assert abs(returns.mean()) < 4 * returns.std() / np.sqrt(len(returns))
    assert returns.std() == pytest.approx(np.sqrt(8), rel=0.2)  # of 8 independent signs


def test_deterministic_evaluation_takes_the_mode_and_stochastic_samples(make_ppo):
    policy = make_ppo().policy.play
    runs = {}
    for mode in Exploration:
        torch.manual_seed(0)
        env = FakeEnv(2)
        runs[mode] = [evaluate(env, policy, 4, 1, mode)["agents"].returns for _ in range(2)]
    np.testing.assert_array_equal(*runs[DETERMINISTIC])
    np.testing.assert_array_equal(*runs[STOCHASTIC])  # drawn from the seed
    assert (runs[DETERMINISTIC][0] != runs[STOCHASTIC][0]).any()


def test_teams_are_scored_separately():
    scores = evaluate(FakeEnv(2, teams=("red", "blue")), both_teams, 4, 0, STOCHASTIC)
    np.testing.assert_array_equal(scores["red"].returns, -scores["blue"].returns)


def both_teams(td):
    red = torch.ones_like(td["red", "observation", "audio"][..., 0, :2])
    return td.set(("red", "action"), red).set(("blue", "action"), -red)


def test_interval_is_the_t_interval():
    values = np.array([1.0, 2.0, 4.0, 9.0])
    low, high = stats.t.interval(0.95, 3, values.mean(), stats.sem(values))
    assert interval(values) == pytest.approx((low, high))
    assert np.isnan(interval(values[:1])).all()


def test_difference_is_the_paired_t_interval():
    rng = np.random.default_rng(0)
    starts = rng.normal(0, 5, 12)  # cancel in the difference
    one, other = starts + rng.normal(1, 1, 12), starts + rng.normal(0, 1, 12)
    expected = stats.ttest_rel(one, other).confidence_interval(0.95)
    mean, low, high = paired_difference(one, other)
    assert mean == pytest.approx(one.mean() - other.mean())
    assert (low, high) == pytest.approx((expected.low, expected.high))
    with pytest.raises(ValueError, match=naming("episodes", "12", "3")):
        paired_difference(one, other[:3])


def test_comparison_line_names_team_means_and_intervals():
    def scores(*returns):
        return Scores(np.array(returns), np.ones(len(returns)), {})

    line = comparison_line("red", scores(3.0, 5.0), scores(0.0, 0.0))
    assert line.startswith("red: return of policy 4.000 [-8.706, 16.706], random 0.000")
    assert "difference 4.000" in line
    assert "\n" not in line


def step_of(done, solved, reward=1.0):
    """Return the ``next`` part of a frame of several worlds with one agent each."""
    agents = {
        "reward": torch.full((len(done), 1, 1), reward),
        "info": {"solved": torch.tensor(solved).reshape(-1, 1, 1)},
    }
    return TensorDict({"done": torch.tensor(done).unsqueeze(-1), "agents": agents}, (len(done),))


STEPS = (
    ([False, False], [True, False]),
    ([True, False], [False, False]),
    ([True, True], [True] * 2),
)


def test_an_episode_is_solved_if_the_goal_is_reached_after_its_last_step():
    tally = EpisodeTally(["agents"], worlds=2, count=2)
    for done, solved in STEPS:
        tally.add(step_of(done, solved))
    assert tally.complete
    assert tally.sums("agents")["solved"].tolist() == [0.0, 1.0]
    assert tally.sums("agents")["return"].tolist() == [2.0, 3.0]


def test_training_episodes_count_the_share_that_ended_solved():
    batch = TensorDict({"next": torch.stack([step_of(*step) for step in STEPS], 1)}, (2, 3))
    means = TrainingEpisodes().add(batch, "agents")
    assert means["solved"] == pytest.approx(2 / 3)  # of the three ends, two are solved
    assert np.isnan(TrainingEpisodes().add(batch[:, :1], "agents")["solved"])


def means_of(stage, last_start):
    episodes = TrainingEpisodes()
    episodes.begin_stage(last_start)
    return episodes.add(stage, "agents")


@pytest.mark.parametrize("pieces", [[30], [7, 13, 10]])
def test_episodes_that_end_early_are_not_too_many_among_those_of_a_stage(pieces):
    """Of the episodes one in five is solved, after 2 steps; the others last 20 steps."""
    rng = np.random.default_rng(0)
    solved = np.zeros((4000, 30), dtype=np.bool_)
    done = np.zeros_like(solved)
    for world in range(len(done)):
        step = -1
        while step < 30:
            early = rng.random() < 0.2
            step += 2 if early else 20
            if step < 30:
                done[world, step], solved[world, step] = True, early
    steps = [step_of(d.tolist(), s.tolist()) for d, s in zip(done.T, solved.T, strict=True)]
    stage = TensorDict({"next": torch.stack(steps, 1)}, done.shape)
    episodes, means = TrainingEpisodes(), []
    episodes.begin_stage(last_start=30 - 20)
    for batch in stage.split(pieces, dim=1):
        means.append(episodes.add(batch, "agents"))
    if len(pieces) == 1:
        assert means[0]["solved"] == pytest.approx(0.2, abs=0.02)
        assert means[0]["length"] == pytest.approx(0.2 * 2 + 0.8 * 20, abs=0.4)
    whole = means_of(stage, last_start=30 - 20)
    assert np.isnan(means_of(stage, last_start=-1)["return"])
    everything = TrainingEpisodes().add(stage, "agents")["solved"]
    assert everything > 0.3 > whole["solved"]


def test_rates_of_solved_episodes_are_printed_for_a_task_with_a_goal():
    def scores(*solved):
        ones = np.ones(len(solved))
        return Scores(ones, ones, {}, np.array(solved))

    policy, baseline = scores(1.0, 0.0, 1.0, 1.0), scores(0.0, 0.0, 0.0, 1.0)
    line = comparison_line("red", policy, baseline)
    assert line.endswith("; solved at the end: policy 75.0 %, random 25.0 %")
    both = joined_scores([{"red": policy}, {"red": baseline}])
    (row,) = score_rows("policy", both)
    assert row["solved"] == 0.5
    (row,) = score_rows("policy", {"red": Scores(np.ones(2), np.ones(2), {})})
    assert "solved" not in row


def test_the_last_evaluation_has_twice_as_many_episodes_or_what_is_asked_for():
    assert EvalCfg().last_episodes == 16
    assert EvalCfg(episodes=2).last_episodes == 4
    assert EvalCfg(final_episodes=100).last_episodes == 100
    with pytest.raises(ValueError, match=naming("eval.final_episodes", "eval.episodes=8")):
        EvalCfg(final_episodes=7)


@pytest.mark.parametrize("wrong", [{"every_frames": 0}, {"episodes": 0}, {"worlds": 0}])
def test_invalid_numbers_raise_an_error_with_their_name(wrong):
    ((name, number),) = wrong.items()
    with pytest.raises(ValueError, match=naming(f"eval.{name}", number)):
        EvalCfg(**wrong)
