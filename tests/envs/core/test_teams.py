"""Teams with own bodies and senses, elimination of players, and scripted teams."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from batches import batch_and_singles, play_and_compare
from composed import compose
from knockouts import knockout
from refusals import naming
from torchrl.collectors import Collector
from torchrl.envs import SerialEnv, check_env_specs

from veca_marl.config import ConfigError
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script, TeamCfg
from veca_marl.sim.body.walker import WalkActionKind, WalkerCfg
from veca_marl.sim.hearing import AudioCfg, AudioQuality
from veca_marl.sim.senses import SensesCfg

STEPS = 13  # two games of 6 steps, and one of a third


@pytest.fixture(scope="module")
def cfg():
    with knockout() as cfg:
        yield cfg


@pytest.fixture(scope="module")
def env(cfg):
    env = VecaEnv(cfg, 3)
    yield env
    env.close()


@pytest.fixture(scope="module")
def rollout(env):
    env.set_seed(4)
    torch.manual_seed(0)
    return env.rollout(STEPS, break_when_any_done=False)


def test_specs_hold(env):
    check_env_specs(env, break_when_any_done="both")


def test_the_mask_is_false_from_elimination_to_the_next_episode(rollout):
    left = torch.cat([rollout[team, "mask"] for team in ("red", "blue")], -1).sum(-1)
    assert left.tolist() == [[3, 3, 2, 2, 1, 1] * 2 + [3]] * 3
    after = torch.cat([rollout["next", team, "mask"] for team in ("red", "blue")], -1).sum(-1)
    assert after.tolist() == [[3, 2, 2, 1, 1, 0] * 2 + [3]] * 3


def test_flags_of_an_eliminated_player_stay_up_until_the_next_episode(rollout):
    for team in ("red", "blue"):
        out = ~rollout["next", team, "mask"].unsqueeze(-1)
        torch.testing.assert_close(rollout["next", team, "terminated"], out)
        torch.testing.assert_close(rollout["next", team, "done"], out)
        assert not rollout["next", team, "truncated"].any()
        torch.testing.assert_close(rollout[team, "mask"], ~rollout[team, "done"].squeeze(-1))
    over = rollout["next", "done"].squeeze(-1)
    assert over.tolist() == [([False] * 5 + [True]) * 2 + [False]] * 3


def test_observation_and_reward_of_an_eliminated_player_are_zero(rollout):
    for team in ("red", "blue"):
        playing = rollout[team, "mask"]
        rewards = rollout["next", team, "reward"].squeeze(-1)
        assert (rewards[playing] > 0.0).all()
        assert (rewards[~playing] == 0.0).all()
        for seen in rollout["next", team, "observation"].values():
            felt = seen.flatten(3).abs().sum(-1)
            assert (felt[playing] > 0.0).all()
            assert (felt[~playing] == 0.0).all()


def test_an_eliminated_player_rests_and_needs_no_action(cfg):
    game = Game(cfg)
    rng = np.random.default_rng(0)
    game.reset(rng)
    while not game.eliminated:
        game.step({p.name: np.array([1.0, 0.0]) for p in game.actors})
    (name,) = game.eliminated
    body = next(p.body for p in game.players if p.name == name)
    before = body.position
    actions = {p.name: np.array([0.0, 0.0]) for p in game.actors} | {name: np.array([np.nan, 1.0])}
    game.step(actions)
    np.testing.assert_allclose(body.position[:2], before[:2], atol=1e-9)
    del actions[name]
    game.step(actions)  # and needs no action
    game.close()


def test_a_batch_equals_single_worlds_with_elimination(cfg):
    envs = batch_and_singles(cfg, worlds=3, seed=7)
    play_and_compare(*envs, steps=20)
    for env in envs:
        env.close()


def test_a_reset_of_one_world_keeps_the_masks_of_the_others(env):
    env.set_seed(4)
    state = env.reset()
    for _ in range(3):
        _, state = env.step_and_maybe_reset(env.rand_action(state))
    masks = {team: state[team, "mask"].clone() for team in env.group_map}
    state["_reset"] = torch.tensor([[True], [False], [False]])
    state = env.reset(state)
    for team, before in masks.items():
        assert state[team, "mask"][0].all()
        torch.testing.assert_close(state[team, "mask"][1:], before[1:])
        torch.testing.assert_close(state[team, "done"][1:].squeeze(-1), ~before[1:])
    assert sum((~mask[1:]).sum() for mask in masks.values()) == 2


@pytest.mark.parametrize("serial", [False, True])
def test_collectors_keep_the_masks(cfg, serial):
    def make():
        return VecaEnv(cfg, 2) if not serial else SerialEnv(2, lambda: VecaEnv(cfg, 1))

    collector = Collector(
        make,
        None,
        frames_per_batch=2 * STEPS,
        total_frames=2 * STEPS,
        auto_register_policy_transforms=False,
    )
    (batch,) = list(collector)
    collector.shutdown()
    batch = batch.reshape(2, STEPS)
    left = torch.cat([batch[team, "mask"].reshape(2, STEPS, -1) for team in ("red", "blue")], -1)
    assert left.sum(-1).tolist() == [[3, 3, 2, 2, 1, 1] * 2 + [3]] * 2


def test_pettingzoo_removes_eliminated_agents(cfg):
    env = VecaParallelEnv(cfg)
    env.reset(seed=0)
    numbers, ends = [], []
    while env.agents:
        numbers.append(len(env.agents))
        actions = {name: np.zeros(2, np.float32) for name in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)
        for given in (observations, rewards, terminations, truncations, infos):
            assert len(given) == numbers[-1]
        ends.append(sum(terminations.values()))
    assert numbers == [3, 3, 2, 2, 1, 1]
    assert ends == [0, 1] * 3
    env.close()


@pytest.mark.parametrize("scripted", ["red", "blue"])
def test_the_episode_ends_when_only_scripted_players_are_left(cfg, scripted):
    env = VecaParallelEnv(replace(cfg, script={scripted: Script.idle}))
    for seed in range(4):
        env.reset(seed=seed)
        steps = 0
        while env.agents:
            env.step({name: np.zeros(2, np.float32) for name in env.agents})
            steps += 1
        assert steps <= 6
        with pytest.raises(RuntimeError, match=naming("reset()", "step()")):
            env.step({})
    env.close()


# ---- own senses and bodies


def test_teams_have_their_own_senses(env):
    assert set(env.observation_spec["red", "observation"].keys()) == {"proprioception"}
    assert set(env.observation_spec["blue", "observation"].keys()) == {"proprioception", "audio"}


def test_a_team_can_have_its_own_body_and_senses(cfg):
    discrete = TeamCfg(WalkerCfg(action=WalkActionKind.discrete))
    deaf = TeamCfg(senses=SensesCfg(audio=AudioCfg(present=False)))
    env = VecaEnv(replace(cfg, team={"red": discrete, "blue": deaf}), 2)
    assert env.full_action_spec["red", "action"].dtype is torch.int64
    assert env.full_action_spec["blue", "action"].shape == (2, 2, 2)
    assert set(env.observation_spec["blue", "observation"].keys()) == {"proprioception"}
    check_env_specs(env)
    env.close()


def test_the_configuration_has_choices_for_single_teams():
    cfg = compose(
        [
            "+task=SoccerTwoPlayer",
            "body=walker",
            "+body@team.attacker.body=walker_discrete",
            "+senses/vision@team.attacker.senses.vision=blind",
            "opponent.defender=random",
        ]
    ).game
    assert cfg.body_of("attacker").action is WalkActionKind.discrete
    assert cfg.body_of("defender").action is WalkActionKind.continuous
    assert not cfg.senses_of("attacker").vision.present
    assert cfg.senses_of("defender").vision.present
    assert cfg.senses_of("attacker").touch == cfg.senses.touch
    assert cfg.script == {"defender": Script.random}


def test_a_team_differs_only_in_the_senses_that_it_sets():
    words = ["+task=SoccerTwoPlayer", "+senses.extra.trial.present=false"]
    words += ["+senses/audio@team.attacker.senses.audio=mono"]
    words += ["+team.attacker.senses.extra.trial.present=true"]
    cfg = compose(words).game
    own, common = cfg.senses_of("attacker"), cfg.senses_of("defender")
    assert common == cfg.senses
    assert own.of("trial").present
    assert not common.of("trial").present
    assert own.of("audio").quality is AudioQuality.mono
    assert common.of("audio").quality is not AudioQuality.mono
    assert own.of("vision") == common.of("vision")


# ---- scripts


def test_a_team_scripted_by_the_expert_acts_like_the_expert_policy(cfg):
    whole = VecaEnv(cfg, 2, seed=0)
    scripted = VecaEnv(replace(cfg, script={"blue": Script.expert}), 2, seed=0)
    assert scripted.group_map == {"red": ["red"]}
    assert "blue" not in scripted.full_observation_spec.keys()  # noqa: SIM118
    other = scripted.rollout(STEPS, ExpertPolicy(scripted))  # until a red player is eliminated
    one = whole.rollout(len(other[0]), ExpertPolicy(whole), break_when_any_done=False)
    assert 1 <= other.shape[1] <= STEPS
    for key in (("red", "observation", "proprioception"), ("next", "red", "reward"), "done"):
        torch.testing.assert_close(one[key], other[key], rtol=0.0, atol=0.0)
    ours, theirs = (env.games[1].world.scene.positions for env in (whole, scripted))
    np.testing.assert_array_equal(ours, theirs)
    whole.close()
    scripted.close()


@pytest.mark.parametrize(("script", "moves"), [(Script.idle, False), (Script.random, True)])
def test_idle_and_random_scripts(cfg, script, moves):
    game, rng = Game(replace(cfg, script={"red": script})), np.random.default_rng(1)
    game.reset(rng)
    assert [player.name for player in game.actors] == ["blue_0", "blue_1"]
    (red,) = game.team("red")
    before = red.body.position
    game.step({p.name: np.zeros(2) for p in game.actors})
    assert bool(np.abs(red.body.position - before)[:2].max() > 1e-6) is moves
    game.close()


# ---- errors


def test_an_unknown_team_is_an_error_that_lists_the_teams(cfg):
    for wrong in ({"team": {"green": TeamCfg()}}, {"script": {"green": Script.idle}}):
        with pytest.raises(ValueError, match=naming("Knockout", "['green']", "['red', 'blue']")):
            Game(replace(cfg, **wrong))


def test_not_all_teams_can_be_scripted(cfg):
    with pytest.raises(ValueError, match=naming("script", "Knockout", "['red', 'blue']")):
        Game(replace(cfg, script={"red": Script.idle, "blue": Script.idle}))


def test_an_unknown_opponent_is_an_error_that_lists_the_choices():
    with pytest.raises(ConfigError, match=naming("opponent.agents=experts", "expert, random")):
        compose(["+task=KickTheBall", "opponent.agents=experts"])


def test_too_many_players_for_the_floor_are_an_error(cfg):
    room = replace(cfg.playground.rooms[0], size_m=(1.5, 1.5, 2.6))
    small = replace(cfg.playground, rooms=[room])
    with pytest.raises(ValueError, match=naming("Knockout", "3 players", f"'{small.name}'", " 2 ")):
        Game(replace(cfg, playground=small))
