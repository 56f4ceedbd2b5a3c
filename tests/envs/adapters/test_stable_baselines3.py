"""Stable-Baselines3 learns on the Gymnasium ids, with its CNN where the layout is `stacked`."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from refusals import naming

import veca_marl  # noqa: F401  registers the ids

stable_baselines3 = pytest.importorskip("stable_baselines3", reason="needs Stable-Baselines3")
layers = pytest.importorskip("stable_baselines3.common.torch_layers")

ID = "veca_marl/KickTheBall-v0"
SMALL_PPO = {"n_steps": 64, "batch_size": 32, "n_epochs": 1}
SMALL_SAC = {"buffer_size": 200, "learning_starts": 20, "batch_size": 8, "train_freq": 16}


@pytest.fixture
def env():
    env = gymnasium.make(ID, playground="simple", layout="stacked")
    yield env
    env.close()


def cnn_of(model):
    extractor = next(m for m in model.policy.modules() if hasattr(m, "extractors"))
    return isinstance(extractor.extractors["vision"], layers.NatureCNN)


def test_stacked_observations_are_images_and_vectors(env):
    assert env.observation_space["vision"] == spaces.Box(0, 255, (6, 84, 84), np.uint8)
    assert env.observation_space["audio"].shape == (500,)
    observation, _ = env.reset(seed=1)
    assert observation in env.observation_space
    arrays, _ = (plain := gymnasium.make(ID, playground="simple")).reset(seed=1)
    np.testing.assert_array_equal(observation["vision"], arrays["vision"].reshape(6, 84, 84))
    np.testing.assert_array_equal(observation["audio"], arrays["audio"].ravel())
    observation, *_ = env.step(env.action_space.sample())
    assert observation in env.observation_space
    plain.close()


def test_an_unknown_layout_is_an_error_that_lists_the_choices():
    with pytest.raises(ValueError, match=naming("'round'", "arrays", "stacked")):
        gymnasium.make(ID, layout="round")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "numbers"), [("PPO", SMALL_PPO), ("SAC", SMALL_SAC)])
def test_it_learns_with_its_cnn(env, name, numbers):
    model = getattr(stable_baselines3, name)("MultiInputPolicy", env, seed=0, **numbers)
    assert cnn_of(model)
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(128)
    after = list(model.policy.parameters())
    assert any((one != other).any() for one, other in zip(before, after, strict=True))
    action, _ = model.predict(env.reset(seed=2)[0])
    assert action in env.action_space


def test_without_the_layout_the_images_are_flattened():
    env = gymnasium.make(ID, playground="simple")
    assert not cnn_of(stable_baselines3.PPO("MultiInputPolicy", env, **SMALL_PPO))
    env.close()
