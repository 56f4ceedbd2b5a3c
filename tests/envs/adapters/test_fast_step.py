"""With and without the fast step, an environment gives the same data."""

from functools import partial

import pytest
import torch
from composed import compose
from duels import duel
from knockouts import knockout
from tensordict import LazyStackedTensorDict, NonTensorData, TensorDictBase
from torchrl.collectors import Collector
from torchrl.data import Unbounded
from torchrl.envs import ParallelEnv, SerialEnv
from torchrl.envs.utils import _StepMDP

from veca_marl import private_parts
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.fast_step import NextState


def ball():
    return compose(["+task=KickTheBall", "playground=simple", "senses/vision=blind"]).game


@pytest.fixture(params=["ball", "duel", "knockout"])
def pair(request):
    context = {"duel": duel, "knockout": knockout}.get(request.param)
    if context is None:
        game = ball()
        game.task.max_seconds = 0.5
        yield from both(game)
    else:
        with context("senses/vision=blind") as game:
            yield from both(game)


def both(game):
    envs = [VecaEnv(game, worlds=3, seed=5, fast_step=fast) for fast in (True, False)]
    yield envs
    for env in envs:
        env.close()


def all_keys(data):
    return set(data.keys(include_nested=True))


def assert_same(one, other):
    assert all_keys(one) == all_keys(other)
    assert one.batch_size == other.batch_size
    assert one.names == other.names
    for key in all_keys(one):
        a, b = one.get(key), other.get(key)
        assert type(a) is type(b), key
        if isinstance(a, torch.Tensor):
            assert a.dtype == b.dtype, key
            assert torch.equal(a, b), key
        elif isinstance(a, TensorDictBase):
            assert a.batch_size == b.batch_size, key
        else:
            assert repr(a) == repr(b), key  # what is no tensor


class RandomPolicy:
    """Random actions, and entries of its own: in a team, at the root, and one that is no tensor."""

    def __init__(self, env):
        self.env, self.torch_rng = env, torch.Generator().manual_seed(3)

    def __call__(self, state):
        for key in self.env.action_keys:
            shape = self.env.full_action_spec[key].shape
            state.set(key, 2.0 * torch.rand(shape, generator=self.torch_rng) - 1.0)
            state.set((key[0], "hidden", "h"), torch.rand(shape, generator=self.torch_rng))
        state.set("recurrent", torch.rand(state.shape, generator=self.torch_rng))
        return state.set("note", NonTensorData("kept", batch_size=state.batch_size))


@pytest.mark.parametrize("breaks", [True, False])
def test_rollouts_are_those_of_torchrl(pair, breaks):
    options = {"break_when_any_done": breaks, "trust_policy": True}
    played = [env.rollout(15, RandomPolicy(env), **options) for env in pair]
    assert_same(*played)


def test_steps_resets_and_masks_are_those_of_torchrl(pair):
    states = [env.reset() for env in pair]
    policies = [RandomPolicy(env) for env in pair]
    mask = torch.tensor([[False], [True], [False]])
    for step in range(12):
        pairs = [
            env.step_and_maybe_reset(policy(state))
            for env, policy, state in zip(pair, policies, states, strict=True)
        ]
        assert_same(*(played for played, _ in pairs))
        assert_same(*(after for _, after in pairs))
        states = [after for _, after in pairs]
        if step == 4:
            states = [
                env.reset(state.set("_reset", mask.clone()))
                for env, state in zip(pair, states, strict=True)
            ]
            assert_same(*states)


def test_collected_batches_are_those_of_torchrl(pair):
    batches = []
    for env in pair:
        collector = Collector(
            lambda env=env: env,
            RandomPolicy(env),
            frames_per_batch=36,
            total_frames=72,
            trust_policy=True,
        )
        batches.append([batch.exclude("collector").clone() for batch in collector])
    for batch in zip(*batches, strict=True):
        assert_same(*batch)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [SerialEnv, ParallelEnv])
def test_batches_of_envs_are_those_of_torchrl(kind):
    options = {"mp_start_method": "fork"} if kind is ParallelEnv else {}
    played = []
    for fast in (True, False):
        env = kind(2, partial(VecaEnv, ball(), worlds=2, fast_step=fast), **options)
        env.set_seed(1)
        torch.manual_seed(1)
        played.append(env.rollout(8, break_when_any_done=False))
        env.close()
    assert_same(*played)


def moved(env):
    return env.step(RandomPolicy(env)(env.reset()))


def unusual_steps(env):
    """Yield steps with unusual data by name."""
    usual = moved(env)
    yield "usual", usual
    yield "masked", usual.copy().set("_reset", usual["next", "done"].clone())
    team = next(iter(env.group_map))
    yield "masked team", usual.copy().set((team, "_reset"), usual["next", team, "done"].clone())
    yield "key missing", usual.exclude(("next", "terminated"))
    yield "team missing", usual.exclude(team)
    yield "named", usual.clone().refine_names("world")
    yield "stacked", torch.stack([usual.clone(), usual.clone()])
    yield "lazily stacked", LazyStackedTensorDict(usual.clone(), usual.clone(), stack_dim=0)
    yield "locked", usual.clone().lock_()


def test_the_next_state_is_that_of_torchrl(pair):
    fast, full = pair
    assert isinstance(fast._step_mdp, NextState)
    assert isinstance(full._step_mdp, _StepMDP)
    for name, state in unusual_steps(fast):
        one, other = fast._step_mdp(state), full._step_mdp(state)
        assert type(one) is type(other), name
        assert_same(one, other)
        assert one.is_locked == other.is_locked, name
        for level in [one, *(one[team] for team in fast.group_map if team in one)]:
            assert level is not state, name  # what a policy writes must not reach what was stored
        one.set("new", torch.zeros(one.batch_size))
        assert "new" not in state, name


def test_nested_data_are_not_shared_with_the_step_before(pair):
    env, _ = pair
    state = moved(env)
    after = env._step_mdp(state)
    for team in env.group_map:
        after[team].set("new", torch.zeros(after[team].batch_size))
        after[team, "observation"].set("new", torch.zeros(after[team].batch_size))
        after[team, "hidden"].set("new", torch.zeros(after[team].batch_size))
    assert not any("new" in key for key in all_keys(state))


def test_the_plan_follows_the_specs(pair):
    env, _ = pair
    before = env._step_mdp
    assert env._step_mdp is before
    more = env.observation_spec.clone()
    more["hint"] = Unbounded((3, 1))
    env.observation_spec = more
    state = moved(env)
    state["next", "hint"] = torch.ones(3, 1)
    assert env._step_mdp(state)["hint"].all()
    assert env._step_mdp is not before


def test_the_compiled_next_state_is_that_of_torchrl(pair):
    env, _ = pair
    state, next_state = moved(env).exclude("note"), env._step_mdp
    compiled = torch.compile(lambda data: next_state(data), backend="eager")
    assert_same(compiled(state), next_state.general(state))


def test_types_are_still_checked_where_asked(pair):
    env, _ = pair
    state = env._step(RandomPolicy(env)(env.reset()))
    team = next(iter(env.group_map))
    wrong = state.clone()
    wrong[team, "reward"] = wrong[team, "reward"].double()
    env.run_type_checks = True
    env._step_proc_data(state)
    with pytest.raises(TypeError, match="reward"):
        env._step_proc_data(wrong)


def test_an_untested_version_of_torchrl_steps_on_the_general_path(monkeypatch):
    with monkeypatch.context() as untested:
        untested.setattr(private_parts, "TESTED_VERSIONS", ("0.1",))
        private_parts.torchrl_is_tested.cache_clear()
        with pytest.warns(UserWarning, match="TorchRL"):
            general = VecaEnv(ball(), worlds=2, seed=5)
        assert not general._fast_step
        slowly = general.rollout(15, RandomPolicy(general))
        general.close()
    private_parts.torchrl_is_tested.cache_clear()
    fast = VecaEnv(ball(), worlds=2, seed=5)
    assert fast._fast_step
    assert_same(fast.rollout(15, RandomPolicy(fast)), slowly)
    fast.close()
