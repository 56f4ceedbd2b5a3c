"""The Gymnasium door: its ids, and what it refuses."""

import importlib
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from duels import duel

import veca_marl
from veca_marl.envs.adapters.gymnasium import VecaGymEnv, single_agent_env

ID = "veca_marl/KickTheBall-v0"
CHEAP = {"playground": "simple", "senses": {"vision": "blind"}}


@pytest.fixture
def env():
    env = gymnasium.make(ID, **CHEAP)
    yield env
    env.close()


def test_every_task_has_an_id():
    ids = [name for name in gymnasium.registry if name.startswith("veca_marl/")]
    assert ids == [f"veca_marl/{task}-v0" for task in veca_marl.list_tasks()]


def in_a_fresh_process(program):
    asked = [sys.executable, "-W", "ignore", "-c", program]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize(
    "imports",
    [
        "import gymnasium, veca_marl",
        "import veca_marl.envs.adapters.gymnasium, gymnasium",
    ],
)
def test_an_import_makes_the_ids_known(imports):
    found = in_a_fresh_process(f"{imports}; print({ID!r} in gymnasium.registry)")
    assert found == "True"


def test_who_does_not_want_gymnasium_does_not_load_it():
    program = "import sys, veca_marl, veca_marl.envs.core.game; print('gymnasium' in sys.modules)"
    assert in_a_fresh_process(program) == "False"


def test_the_id_takes_the_choices_of_make(env):
    assert set(env.observation_space.spaces) == {"audio"}
    discrete = gymnasium.make(ID, body="walker_discrete", **CHEAP)
    assert discrete.action_space == gymnasium.spaces.Discrete(7)
    discrete.reset(seed=0)
    discrete.step(discrete.action_space.sample())
    discrete.close()


def test_a_vector_of_envs_has_a_seed_for_each():
    envs = gymnasium.make_vec(ID, num_envs=2, **CHEAP)
    observations, _ = envs.reset(seed=3)
    alone = single_agent_env("KickTheBall", **CHEAP)
    for index in range(2):
        seen, _ = alone.reset(seed=3 + index)
        np.testing.assert_array_equal(observations["audio"][index], seen["audio"])
    alone.close()
    envs.close()


def test_gymnasiums_own_random_numbers_are_those_of_the_game(env):
    env.reset(seed=4)
    assert env.unwrapped.np_random is env.unwrapped._played.rng


def test_a_picture_shows_the_eyes_and_the_room():
    env = gymnasium.make(ID, render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().dtype == np.uint8
    env.close()


def test_there_is_no_step_without_an_episode(env):
    with pytest.raises(RuntimeError, match=r"reset\(\) before step"):
        env.unwrapped.step(np.zeros(2, np.float32))


def test_a_wrong_action_is_answered_with_what_is_right(env):
    env.reset()
    with pytest.raises(ValueError, match=r"agents: action .* two numbers"):
        env.unwrapped.step(np.zeros(3, np.float32))


def test_a_task_of_several_agents_says_which_door_to_take():
    said = r"Duel is played by 3 agents \['red', 'blue_0', 'blue_1'\].*parallel_env\('Duel'\)"
    with duel("senses/vision=blind") as cfg, pytest.raises(ValueError, match=said):
        VecaGymEnv(cfg)


def test_wrong_choices_are_answered_with_those_there_are():
    with pytest.raises(ValueError, match=r"unknown body 'bird'.*choices:.*walker"):
        gymnasium.make(ID, body="bird")


def test_without_gymnasium_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "veca_marl.envs.adapters.gymnasium")
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'veca_marl\[gymnasium\]'"):
        importlib.import_module("veca_marl.envs.adapters.gymnasium")
