"""VecaEnv: batches of games as a TorchRL environment, in one process and in several."""

from functools import partial

import numpy as np
import pytest
import torch
from composed import compose
from refusals import naming
from tensordict import TensorDict
from torch import multiprocessing
from torchrl.collectors import MultiSyncCollector
from torchrl.envs import ParallelEnv, check_env_specs

from veca_marl.api import make
from veca_marl.envs.adapters.torchrl.env import VecaEnv

CHEAP = ("playground=simple", "senses/vision=blind")


def cfg_of(*overrides):
    return compose(["+task=KickTheBall", *overrides]).game


@pytest.fixture
def env():
    env = VecaEnv(cfg_of(*CHEAP), worlds=3, seed=4)
    yield env
    env.close()


def with_action(env, value):
    state = env.reset()
    return state.set(("agents", "action"), torch.as_tensor(value))


def test_leaves_have_the_shapes_worlds_players_array(env):
    played = env.step(env.rand_action(env.reset()))
    assert played.batch_size == (3,)
    assert played["agents", "action"].shape == (3, 1, 2)
    assert played["next", "agents", "observation", "audio"].shape == (3, 1, 2, 250)
    assert played["next", "agents", "reward"].shape == (3, 1, 1)
    assert played["next", "agents", "info", "kick"].shape == (3, 1, 1)
    assert played["next", "done"].shape == (3, 1)


@pytest.mark.parametrize("worlds", [0, -1])
def test_there_is_at_least_one_world(worlds):
    with pytest.raises(ValueError, match=f"worlds={worlds}"):
        VecaEnv(cfg_of(*CHEAP), worlds=worlds)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1.5, -2.0])
def test_an_invalid_action_stops_the_step_of_all_worlds(env, wrong):
    """The action of the last world is invalid; the worlds before it do not move either."""
    action = torch.zeros(3, 1, 2)
    action[:, 0, 0] = 1.0
    action[2, 0, 1] = wrong
    state = with_action(env, action)
    before = [game.world.scene.positions.copy() for game in env.games]
    with pytest.raises(ValueError, match=naming("world 2", "agents", "'move'")):
        env.step(state)
    for game, positions in zip(env.games, before, strict=True):
        np.testing.assert_array_equal(game.world.scene.positions, positions)
        assert game.steps == 0


@pytest.mark.parametrize("shape", [(3, 1, 3), (3, 2, 2), (2, 1, 2), (3, 2)])
def test_a_wrong_shape_is_refused(env, shape):
    state = env.reset()
    state = state.exclude(("agents", "action"))
    loose = torch.zeros(shape)
    with pytest.raises((ValueError, RuntimeError), match=r"shape|batch"):
        env.step(state.set(("agents", "action"), loose))
    assert all(game.steps == 0 for game in env.games)


def test_numbers_that_numpy_lacks_are_refused_with_the_type_that_is_expected(env):
    state = with_action(env, torch.zeros(3, 1, 2, dtype=torch.bfloat16))
    with pytest.raises(ValueError, match=naming("agents", "torch.bfloat16", "torch.float32")):
        env.step(state)


def test_the_reward_of_a_step_is_that_of_its_terms(env):
    state = env.reset()
    for _ in range(5):
        state = env.step(env.rand_action(state))["next"]
        terms = state["agents", "info"]
        expected = terms["kick"] * 1.0 + terms["approach"] * 0.01
        torch.testing.assert_close(state["agents", "reward"], expected)


def test_equal_seeds_give_equal_batches_of_different_worlds(env):
    first = [env.set_seed(9), env.reset()][1].clone()
    again = [env.set_seed(9), env.reset()][1].clone()
    other = [env.set_seed(10), env.reset()][1].clone()
    audio = ("agents", "observation", "audio")
    assert torch.equal(first[audio], again[audio])
    assert not torch.equal(first[audio], other[audio])
    assert not torch.equal(first[audio][0], first[audio][1])


def test_envs_that_were_not_seeded_differ():
    one, other = VecaEnv(cfg_of(*CHEAP)), VecaEnv(cfg_of(*CHEAP))
    audio = ("agents", "observation", "audio")
    assert not torch.equal(one.reset()[audio], other.reset()[audio])
    one.close()
    other.close()


def test_the_constructor_seeds_as_set_seed_does(env):
    fresh = VecaEnv(cfg_of(*CHEAP), worlds=3, seed=9)
    env.set_seed(9)
    audio = ("agents", "observation", "audio")
    assert torch.equal(fresh.reset()[audio], env.reset()[audio])
    fresh.close()


def test_a_rollout_resets_worlds_that_are_done():
    env = VecaEnv(cfg_of(*CHEAP, "task.max_seconds=0.2"), worlds=2)
    rollout = env.rollout(12, break_when_any_done=False)
    ended = rollout["next", "truncated"].squeeze(-1).sum(1).tolist()
    assert ended == [2, 2]
    env.close()


def test_worlds_can_end_at_different_times():
    env = VecaEnv(cfg_of(*CHEAP, "task.max_seconds=0.4"), worlds=2)
    state = env.reset()
    for _ in range(5):
        _, state = env.step_and_maybe_reset(env.rand_action(state))
    state["_reset"] = torch.tensor([[True], [False]])
    state = env.reset(state)
    ended = []
    for _ in range(10):
        played, state = env.step_and_maybe_reset(env.rand_action(state))
        ended.append(played["next", "done"].squeeze(-1).tolist())
    assert [step for step, (_, second) in enumerate(ended) if second] == [4]
    assert [step for step, (first, _) in enumerate(ended) if first] == [9]
    env.close()


def test_a_masked_world_neither_moves_nor_needs_an_action(env):
    env.set_seed(4)
    state = env.reset()
    action = torch.full((3, 1, 2), 0.5)
    action[1] = torch.nan
    state["agents", "action"] = action
    state["_step"] = torch.tensor([[True], [False], [True]])
    before = state["agents", "observation", "audio"].clone()
    after = env.step(state)["next"]
    assert [game.steps for game in env.games] == [1, 0, 1]
    moved = (after["agents", "observation", "audio"] != before).flatten(1).any(1)
    assert moved.tolist() == [True, False, True]
    assert after["agents", "reward"][1] == 0.0


def test_a_rollout_goes_on_until_all_worlds_are_done():
    blind_walkers = ("body=walker", "senses/vision=blind")
    game = compose(["+task=PushOut1v1", *blind_walkers, "task.max_seconds=2.0"]).game
    env = VecaEnv(game, worlds=4, seed=0)
    state = env.reset()
    for _ in range(10):  # world 0 is 10 steps ahead of the others
        state["_step"] = torch.tensor([[True], [False], [False], [False]])
        state = env.step_mdp(env.step(env.rand_action(state)))
    del state["_step"]
    rollout = env.rollout(200, auto_reset=False, tensordict=state, break_when_all_done=True)
    assert rollout["next", "done"][:, -1].all()
    first = rollout["next", "done"].squeeze(-1).int().argmax(1)
    assert first[0] < first[1:].max()
    env.close()


def test_reward_terms_are_information_and_not_observation(env):
    spec = env.full_observation_spec["agents"]
    assert set(spec.keys()) == {"observation", "info"}
    assert set(spec["info"].keys()) == {"kick", "approach"}
    assert set(spec["observation"].keys()) == {"audio"}


def assert_data_on(env, device):
    action = torch.zeros(env.full_action_spec["agents", "action"].shape)
    for played in (env._reset(), env._step(TensorDict({"agents": {"action": action}}, [2]))):
        assert played.device == torch.device(device)
        for key, value in played.items(True, True):
            assert value.device == torch.device(device), key


def test_data_are_on_the_device_of_the_env(monkeypatch):
    env = VecaEnv(cfg_of(*CHEAP), worlds=2, seed=1).to("cpu")
    assert env.full_action_spec.device == torch.device("cpu")
    assert_data_on(env, "cpu")
    # tensors on this device have no values; TorchRL cannot move bounds there, but data can be moved
    monkeypatch.setattr(env, "_device", torch.device("meta"))
    assert_data_on(env, "meta")
    env.close()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs CUDA")
def test_an_env_on_cuda_gives_the_data_of_the_cpu():
    rollouts = []
    for device in ("cpu", "cuda"):
        env = VecaEnv(cfg_of(*CHEAP), worlds=2, seed=1).to(device)
        check_env_specs(env)
        env.set_seed(1)
        action = torch.full(env.full_action_spec["agents", "action"].shape, 0.5, device=device)
        policy = partial(TensorDict.set, key=("agents", "action"), item=action)
        rollouts.append(env.rollout(15, policy, break_when_any_done=False, trust_policy=True))
        env.close()
    assert (rollouts[0] == rollouts[1].cpu()).all()


def test_a_picture_of_each_world_shows_the_senses_and_the_room():
    env = VecaEnv(cfg_of("playground=simple"), worlds=2, seed=1)
    with pytest.raises(RuntimeError, match=naming("reset()", "render()")):
        env.render()
    env.reset()
    first, second = env.render(), env.render(1)
    assert (first.shape, first.dtype) == ((360, 640, 3), np.uint8)
    assert (first != second).any()
    assert env.render(width=200, height=100, panels=False).shape == (100, 200, 3)
    np.testing.assert_array_equal(env.render(), first)
    with pytest.raises(IndexError, match=naming("world=2", "2 worlds")):
        env.render(2)
    env.close()


def test_a_closed_env_has_closed_its_worlds(env):
    other = VecaEnv(cfg_of(*CHEAP), worlds=2)
    games, state = other.games, with_action(other, torch.zeros(2, 1, 2))
    other.close()
    assert all(not game.world.client.isConnected() for game in games)
    for use in (other.reset, lambda: other.step(state), other.render):
        with pytest.raises(RuntimeError, match=naming("environment")):
            use()


def make_env():
    """For worker processes."""
    return VecaEnv(cfg_of(*CHEAP), worlds=2)


def test_it_works_in_a_parallel_env_of_forked_processes():
    env = ParallelEnv(2, make_env, mp_start_method="fork")
    check_env_specs(env)
    env.set_seed(1)
    rollout = env.rollout(5)
    assert rollout.batch_size == (2, 2, 5)
    env.close()


@pytest.mark.slow
def test_it_works_in_a_parallel_env_of_spawned_processes():
    env = ParallelEnv(2, make_env, mp_start_method="spawn")
    assert env.rollout(3).batch_size == (2, 2, 3)
    env.close()


@pytest.fixture
def forking():
    before = multiprocessing.get_start_method(allow_none=True)
    multiprocessing.set_start_method("fork", force=True)
    yield
    multiprocessing.set_start_method(before, force=True)


def collected(seed):
    torch.manual_seed(seed)
    collector = MultiSyncCollector(
        [partial(VecaEnv, cfg_of(*CHEAP), 2)] * 2,
        None,
        frames_per_batch=40,
        total_frames=80,
        cat_results="stack",
        auto_register_policy_transforms=False,
    )
    collector.set_seed(seed)
    batches = [batch["next", "agents", "observation", "audio"].clone() for batch in collector]
    collector.shutdown()
    return batches


@pytest.mark.usefixtures("forking")
def test_it_works_in_a_collector_of_several_processes():
    batches = collected(0)
    assert [batch.shape[:3] for batch in batches] == [(2, 2, 10)] * 2
    assert not torch.equal(batches[0][0], batches[0][1])  # the processes play different games


def test_an_agent_without_any_sense_is_refused():
    with pytest.raises(ValueError, match=naming("['vision', 'audio']")):
        make("KickTheBall", senses={"vision": "blind", "audio": "deaf"})
