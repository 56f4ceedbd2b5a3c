"""The Gymnasium adapter: arguments, pictures and errors."""

import gymnasium
import numpy as np
import pytest
from duels import duel
from refusals import naming

from veca_marl.api import gym_env
from veca_marl.envs.adapters.gymnasium import VecaGymEnv

ID = "veca_marl/KickTheBall-v0"
CHEAP = {"playground": "simple", "senses": {"vision": "blind"}}


@pytest.fixture
def env():
    env = gymnasium.make(ID, **CHEAP)
    yield env
    env.close()


def test_the_id_takes_the_choices_of_make(env):
    assert set(env.observation_space.spaces) == {"audio"}
    discrete = gymnasium.make(ID, body="walker_discrete", **CHEAP)
    assert discrete.action_space == gymnasium.spaces.Discrete(7)
    discrete.reset(seed=0)
    discrete.step(discrete.action_space.sample())
    discrete.close()


def test_each_env_of_a_vector_has_its_own_seed():
    envs = gymnasium.make_vec(ID, num_envs=2, **CHEAP)
    observations, _ = envs.reset(seed=3)
    alone = gym_env("KickTheBall", **CHEAP)
    for index in range(2):
        seen, _ = alone.reset(seed=3 + index)
        np.testing.assert_array_equal(observations["audio"][index], seen["audio"])
    alone.close()
    envs.close()


def test_np_random_is_the_generator_of_the_episode(env):
    env.reset(seed=4)
    assert env.unwrapped.np_random is env.unwrapped._played.rng


def test_a_picture_shows_the_eyes_and_the_room():
    env = gymnasium.make(ID, render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().dtype == np.uint8
    env.close()


def test_human_shows_each_step_in_a_window(monkeypatch):
    pygame = pytest.importorskip("pygame", reason="the window needs the extra [play]")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make(ID, render_mode="human")
    env.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    env.step(env.action_space.sample())
    assert (pygame.surfarray.array3d(pygame.display.get_surface()) != shown).any()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(env.action_space.sample())
    assert pygame.display.get_surface() is None, "a person has closed it"
    env.step(env.action_space.sample())
    env.close()


REFUSED = [{"episode": -1}, {"episode": "x"}, {"world": -1}, {"world": 0.5}, 5]


@pytest.mark.parametrize("options", REFUSED, ids=str)
def test_a_refused_reset_leaves_the_episodes_as_they_are(options):
    refused, other = gym_env("KickTheBall", **CHEAP), gym_env("KickTheBall", **CHEAP)
    for env in (refused, other):
        env.reset(seed=3)
    with pytest.raises(ValueError, match=r"episode|world"):
        refused.reset(seed=9, options=options)
    found, expected = refused.reset()[0], other.reset()[0]
    np.testing.assert_array_equal(found["audio"], expected["audio"])
    refused.close()
    other.close()


def test_there_is_no_step_without_an_episode(env):
    with pytest.raises(RuntimeError, match=naming("reset()", "step()")):
        env.unwrapped.step(np.zeros(2, np.float32))


@pytest.mark.parametrize(
    "use",
    [lambda env: env.reset(), lambda env: env.step(np.zeros(2, np.float32)), VecaGymEnv.render],
)
def test_a_closed_environment_says_so(use):
    env = gym_env("KickTheBall", **CHEAP, render_mode="rgb_array")
    env.reset()
    env.close()
    env.close()
    with pytest.raises(RuntimeError, match=naming("environment")):
        use(env)


def test_an_invalid_action_is_an_error_with_the_expected_shape(env):
    env.reset()
    with pytest.raises(ValueError, match=naming("agents", "'move'", "(3,)", "(2,)")):
        env.unwrapped.step(np.zeros(3, np.float32))


def test_a_task_of_several_agents_names_the_function_to_use():
    named = naming("['red', 'blue_0', 'blue_1']", "parallel_env('Duel')")
    with duel("senses/vision=blind") as cfg, pytest.raises(ValueError, match=named):
        VecaGymEnv(cfg)


def test_an_unknown_choice_is_an_error_that_lists_the_choices():
    with pytest.raises(ValueError, match=naming("'bird'", "walker")):
        gymnasium.make(ID, body="bird")
