"""Properties that every task must have, with every kind of action."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from paths import HELPERS
from rollouts import CONTESTS, EPISODE, digest, digests, game_cfg, play, returns
from torchrl.envs import check_env_specs

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, random_action
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.task import SOLVED, TASKS
from veca_marl.sim.physics.bullet_state import saved_state, solving_order

# a walker, a joint-level body with hands, walkers with voices in a house, verbs and doors;
# `test_every_start.py` compares the starts of every task with those of another process
IN_EVERY_PROCESS = ["KickTheBall", "GrabObject", "MultiAgentNav", "BabyzumasRevenge"]
SLOW = pytest.mark.slow
# the farther or the more often the better
WITHOUT_GOAL = {"CrawlBaby", "HandRegard", "KickTheBall", "RunBaby", "SelfTouch"}


def leaves(rollout):
    return dict(rollout.items(include_nested=True, leaves_only=True))


def test_specs_hold(env):
    check_env_specs(env, break_when_any_done="both")


def test_data_are_finite_and_in_their_specs(env, rollout):
    for spec, seen in (
        (env.full_observation_spec, rollout),
        (env.full_observation_spec, rollout["next"]),
        (env.full_reward_spec, rollout["next"]),
        (env.full_done_spec, rollout["next"]),
    ):
        for key, leaf in spec.items(include_nested=True, leaves_only=True):
            for step in seen.select(key).unbind(-1):
                assert step[key].isfinite().all(), key
                assert leaf.is_in(step[key]), key


def test_the_same_seed_gives_the_same_bytes_in_a_used_env(env, rollout):
    play(env, 10, seed=99)
    assert digest(play(env, rollout.shape[1], seed=1)) == digest(rollout)


def test_bullet_solves_contacts_in_the_same_order_in_every_episode(cfg):
    """Filters of collisions that were set in one episode would change it in those after it."""
    game = Game(cfg)
    orders = []
    for episode in range(3):
        game.reset(Episodes(episode).next())
        orders.append(solving_order(saved_state(game.world.client)))
        for player in game.actors:
            player.body.rest()
        for _ in range(3):
            game.advance()
    game.close()
    assert orders[0] == orders[1] == orders[2]


@pytest.mark.parametrize(
    "tasks", [IN_EVERY_PROCESS, pytest.param(sorted(TASKS), marks=SLOW)], ids=["some", "all"]
)
def test_the_same_seed_gives_the_same_bytes_in_every_process(tasks):
    """A rollout of each task here, where others were played before, and in a fresh process.

    The other process has other hashes of strings.
    """
    program = [sys.executable, str(HELPERS / "rollouts.py"), "5", "1", *tasks]
    env = os.environ | {"PYTHONHASHSEED": "1"}
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True, env=env) as other:
        here = digests(tasks, steps=5, seed=1)
        there = other.communicate()[0].splitlines()
    assert len(here) == len(tasks)
    assert here == there


def test_another_seed_gives_another_start(env, rollout):
    other = play(env, 1, seed=2)
    assert digest(other["next"]) != digest(rollout[:, :1]["next"])


def test_the_worlds_of_a_batch_differ(rollout):
    assert digest(rollout[0]) != digest(rollout[1])


def test_successive_steps_share_no_memory(env):
    state = env.reset()
    seen = []
    for _ in range(3):
        state = env.step(env.rand_action(state))["next"]
        seen.append(leaves(state))
    for key in seen[0]:
        arrays = [step[key].numpy() for step in seen]
        assert not np.shares_memory(arrays[0], arrays[1]), key
        assert not np.shares_memory(arrays[1], arrays[2]), key


def test_no_sense_is_constant(env, rollout):
    for team in env.group_map:
        for name, seen in rollout[team, "observation"].items():
            changes = (seen[:, 1:] != seen[:, :-1]).flatten(2).any(2)
            # a body may touch nothing for seconds, or walk against a wall of one colour
            least = {"touch": 0.0, "vision": 0.1}.get(name, 0.5)
            assert changes.float().mean() > least, f"{team} {name}"


def test_an_episode_starts_alike_whatever_was_played_before(task, kind):
    """Random actions for 30 steps, or none: the next episode depends on its number alone."""
    game, starts = Game(game_cfg(task, kind)), []
    for steps in (0, 30):
        episodes, rng = Episodes(seed=7), np.random.default_rng(5)
        game.reset(episodes.next())
        for _ in range(steps):
            game.step({p.name: random_action(p.body.action_spec, rng) for p in game.players})
        game.reset(episodes.next())
        starts.append({p.name: game.observe(p) for p in game.players})
    for name, senses in starts[0].items():
        for sense, seen in senses.items():
            np.testing.assert_array_equal(seen, starts[1][name][sense], err_msg=sense)
    game.close()


def test_the_reward_is_the_weighted_sum_of_the_terms(env, rollout):
    weights = env.games[0].weights
    for team in env.group_map:
        terms = rollout["next", team, "info"]
        reported = {SOLVED, *env.games[0].team(team)[0].body.info()}
        assert set(terms.keys()) - reported == set(weights)
        expected = sum(weight * terms[name] for name, weight in weights.items())
        torch.testing.assert_close(rollout["next", team, "reward"], expected)


def test_terms_are_those_of_the_declared_weights(task):
    assert set(TASKS[task].cfg_type()().weights) == set(game_cfg(task).task.weights)


def test_the_docstring_explains_every_term(task):
    explained = TASKS[task].__doc__.split("Terms:")[1]
    for term in TASKS[task].cfg_type()().weights:
        assert f"{term}:" in explained


def test_a_task_with_a_goal_reports_whether_it_is_reached(task, env, rollout):
    has_goal = TASKS[task].has_goal()
    assert has_goal == (task not in WITHOUT_GOAL)
    assert has_goal == ("is solved (`solved`)" in " ".join(TASKS[task].__doc__.split()))
    for team in env.group_map:
        assert (SOLVED in set(rollout["next", team, "info"].keys())) == has_goal


def test_episodes_are_truncated_after_max_seconds(rollout):
    """Unless a rule terminates one before, the next one begins in the step after the last."""
    for world in rollout["next"]:
        steps = 0
        for done, truncated in zip(world["done"], world["truncated"], strict=True):
            steps += 1
            assert truncated.item() == (steps == EPISODE)
            steps = 0 if done else steps


def test_an_episode_is_done_if_it_is_terminated_or_truncated(rollout):
    flags = rollout["next"]
    torch.testing.assert_close(flags["done"], flags["terminated"] | flags["truncated"])


def test_flags_of_teams_are_those_of_the_root(env, rollout):
    for team in env.group_map:
        for flag in ("done", "terminated", "truncated"):
            ours = rollout["next", team, flag]
            root = rollout["next", flag].unsqueeze(2).expand_as(ours)
            playing = rollout["next", team].get("mask", torch.ones(ours.shape[:-1]) > 0)
            torch.testing.assert_close(ours[playing], root[playing])


def test_the_group_map_names_every_player_once(env):
    names = [name for team in env.group_map.values() for name in team]
    assert names == [player.name for player in env.games[0].players]
    assert len(set(names)) == len(names)
    assert list(env.group_map) == [team.name for team in env.cfg.teams]


@pytest.mark.slow  # whole episodes; tests/envs/tasks checks one aspect of each expert quickly
def test_the_expert_has_a_higher_return_than_the_random_policy(task, kind):
    cfg = game_cfg(task, kind)
    # between two teams the random policy wins half of its games: its mean needs many of them; so
    # does that of an expert with a body that is not the task's own (PutDownBlock by set-points)
    # a random walk reaches the target, or is missed by the car, in some episodes
    single = (6, 12) if kind == "own" else (40, 12)
    n_expert, n_random = single if len(cfg.teams) == 1 else (10, 40)
    if task in CONTESTS and kind == "own":
        # crawling bodies hardly score at random; their experts need neither eyes nor skin
        cfg, n_random = game_cfg(task, kind, "senses/vision=blind", "senses/touch=numb"), 10
    expert, random = returns(cfg, n_expert, Script.expert), returns(cfg, n_random, Script.random)
    error = np.sqrt(expert.var(ddof=1) / n_expert + random.var(ddof=1) / n_random)
    # a least margin: few episodes may have equal returns; those of SelfTouch are at most 1
    assert expert.mean() > random.mean() + 2.0 * max(error, 0.05)
