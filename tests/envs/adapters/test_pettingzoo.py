"""The PettingZoo adapter with several teams, and its errors."""

import numpy as np
import pytest
from composed import compose
from duels import STEPS, duel
from gymnasium import spaces
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils import parallel_to_aec
from refusals import naming

from veca_marl.api import parallel_env
from veca_marl.bench.command import free_play
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv

AGENTS = ["red", "blue_0", "blue_1"]


@pytest.fixture
def cfg():
    with duel("senses/vision=blind") as cfg:
        yield cfg


@pytest.fixture
def env(cfg):
    env = VecaParallelEnv(cfg)
    yield env
    env.close()


def still(env):
    return {name: np.zeros(2, np.float32) for name in env.agents}


def test_a_game_of_two_teams_passes_pettingzoos_tests(env, cfg):
    parallel_api_test(env, num_cycles=10)
    parallel_seed_test(lambda: VecaParallelEnv(cfg), num_cycles=10)


# it recommends one array as observation and numbers in all names
@pytest.mark.filterwarnings("ignore::UserWarning:pettingzoo.test.api_test")
def test_agents_can_also_act_in_turn(env):
    api_test(parallel_to_aec(env), num_cycles=10)


def test_agents_are_the_players_while_an_episode_lasts(env):
    assert (env.possible_agents, env.agents) == (AGENTS, [])
    env.reset()
    assert env.agents == AGENTS
    for _ in range(STEPS):
        assert env.num_agents == 3
        _, _, terminations, truncations, _ = env.step(still(env))
    assert terminations == dict.fromkeys(AGENTS, True)
    assert truncations == dict.fromkeys(AGENTS, False)
    assert env.agents == []


def test_each_agent_has_its_own_rewards_and_senses(env, cfg):
    """The same as `VecaEnv`, player by player; no two players have the same reward."""
    other = VecaEnv(cfg, seed=3)
    state = other.reset()
    observations, infos = env.reset(seed=3)
    assert all(infos[name]["terms"] == {"place": 0.0, "luck": 0.0} for name in AGENTS)
    state = other.step(state.update(other.full_action_spec.zero()))["next"]
    observations, rewards, _, _, infos = env.step(still(env))
    for name, (team, index) in zip(AGENTS, (("red", 0), ("blue", 0), ("blue", 1)), strict=True):
        row = state[team][0, index]
        np.testing.assert_array_equal(observations[name]["audio"], row["observation", "audio"])
        assert np.float32(rewards[name]) == row["reward"].item()
        terms = infos[name]["terms"]
        assert rewards[name] == terms["place"] + 0.5 * terms["luck"]
    assert len(set(rewards.values())) == 3
    other.close()


def test_returned_arrays_do_not_change_in_later_steps():
    game = compose(["+task=ObjectNav", "playground=simple", "body=mitten"]).game
    senses = ("vision", "audio", "touch", "proprioception")
    with free_play(game, 2, senses=senses) as cfg:
        env = VecaParallelEnv(cfg, seed=1)
        seen, _ = env.reset()
        kept = {(n, s): array.copy() for n in env.agents for s, array in seen[n].items()}
        assert {sense for _, sense in kept} == {"vision", "audio", "touch", "proprioception"}
        for _ in range(2):
            later, *_ = env.step({name: env.action_space(name).sample() for name in env.agents})
        for (name, sense), array in kept.items():
            np.testing.assert_array_equal(seen[name][sense], array, err_msg=sense)
            assert (later[name][sense] != array).any(), sense
            assert later[name] in env.observation_space(name)
        env.close()


def test_spaces_are_those_of_the_specs():
    env = parallel_env(
        "KickTheBall", body="walker_discrete", overrides=["senses.vision.depth=true"]
    )
    assert env.action_space("agents") == spaces.Discrete(7)
    senses = env.observation_space("agents")
    assert senses["vision"] == spaces.Box(0, 255, (2, 3, 84, 84), np.uint8)
    assert senses["audio"].low.min() == -8.0
    assert senses["audio"].high.max() == np.inf
    assert senses["depth"].shape == (2, 84, 84)
    observations, _ = env.reset()
    assert observations["agents"] in senses
    # a plain int does as well as what a space samples
    env.step({"agents": 1})
    env.close()


def test_a_picture_shows_the_eyes_and_the_room():
    env = parallel_env("KickTheBall", render_mode="rgb_array")
    with pytest.raises(RuntimeError, match=naming("reset()", "render()")):
        env.render()
    env.reset(seed=0)
    picture = env.render()
    assert (picture.shape[0], picture.shape[2], picture.dtype) == (360, 3, np.uint8)
    env.step({"agents": np.ones(2, np.float32)})
    assert (env.render() != picture).any()
    assert env.metadata["render_fps"] == 25
    env.close()
    env.close()  # closing twice is harmless


def test_human_shows_each_step_in_a_window(monkeypatch):
    pygame = pytest.importorskip("pygame", reason="the window needs the extra [play]")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = parallel_env("MultiAgentNav", render_mode="human", overrides=["task.max_seconds=1"])
    env.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert shown.shape == (960, 540, 3)
    assert shown.std() > 10
    env.step({name: env.action_space(name).sample() for name in env.agents})
    assert (pygame.surfarray.array3d(pygame.display.get_surface()) != shown).any()
    assert env.render() is None
    env.close()
    assert pygame.display.get_surface() is None


def test_render_needs_a_render_mode(env):
    env.reset()
    with pytest.raises(RuntimeError, match="rgb_array"):
        env.render()


@pytest.mark.parametrize(
    ("actions", "parts"),
    [
        ({"green": np.zeros(2)}, ("['green']", "'blue_0'")),
        ({"blue_0": None}, ("['blue_0']", "'red'")),
        ({"blue_0": np.zeros(3)}, ("blue_0", "(3,)", "(2,)")),
        ({"blue_1": np.full(2, np.nan)}, ("blue_1", "nan", "[-1, 1]")),
        ({"red": "forward"}, ("red", "'move'", "<U7")),
    ],
)
def test_invalid_actions_are_errors_that_name_agent_and_part(env, actions, parts):
    env.reset()
    actions = still(env) | actions
    with pytest.raises(ValueError, match=naming(*parts)):
        env.step({name: row for name, row in actions.items() if row is not None})
    env.step(still(env))  # and the game goes on


def test_a_closed_environment_says_so(cfg):
    env = VecaParallelEnv(cfg)
    env.reset()
    env.close()
    for use in (env.reset, lambda: env.step({name: np.zeros(2) for name in AGENTS})):
        with pytest.raises(RuntimeError, match=naming("environment")):
            use()


def test_there_is_no_step_without_an_episode(env):
    actions = {name: np.zeros(2) for name in AGENTS}
    with pytest.raises(RuntimeError, match=naming("reset()", "step()")):
        env.step(actions)
    env.reset()
    for _ in range(STEPS):
        env.step(actions)
    with pytest.raises(RuntimeError, match=naming("reset()", "step()")):
        env.step(actions)


@pytest.mark.parametrize("space", ["observation_space", "action_space"])
def test_an_unknown_agent_is_an_error_that_lists_the_agents(env, space):
    with pytest.raises(ValueError, match=naming("'green'", "'red'", "'blue_0'")):
        getattr(env, space)("green")


@pytest.mark.parametrize(
    ("task", "choices", "parts"),
    [
        ("Chess", {}, ("'Chess'", "KickTheBall")),
        ("KickTheBall", {"body": "bird"}, ("'bird'", "walker")),
        ("KickTheBall", {"render_mode": "film"}, ("render_mode='film'", "human", "rgb_array")),
        ("KickTheBall", {"seed": -1}, ("seed=-1",)),
    ],
)
def test_unknown_choices_are_errors_that_list_the_choices(task, choices, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        parallel_env(task, **choices)
