"""One batch of worlds and the same worlds one by one, played with masks and partial resets."""

from functools import partial

import numpy as np
import torch
from rollouts import fill_actions
from torchrl.envs import SerialEnv

from veca_marl.envs.adapters.torchrl.env import VecaEnv


def batch_and_singles(cfg, worlds, seed):
    """Return a `VecaEnv` of some worlds and TorchRL's `SerialEnv` of each of them alone."""
    return VecaEnv(cfg, worlds, seed), single_worlds(cfg, worlds, seed)


def single_worlds(cfg, worlds, seed):
    """Return TorchRL's `SerialEnv` of the worlds of a batch, each of them alone."""
    alone = [partial(VecaEnv, cfg, 1, seed, first_world=world) for world in range(worlds)]
    return SerialEnv(worlds, alone)


def leaves(tensordict):
    return dict(tensordict.items(include_nested=True, leaves_only=True))


def assert_equal(batch, singles):
    """Compare bit by bit; the singles have an axis more, of length 1."""
    ours, theirs = leaves(batch), leaves(singles.squeeze(1))
    assert set(ours) == set(theirs)
    for key, value in ours.items():
        assert torch.equal(value, theirs[key]), key


def play_and_compare(batch, singles, steps):
    """Play both with the same random actions, `_step` masks and `_reset` masks."""
    rng = np.random.default_rng(3)
    envs, states = (batch, singles), [batch.reset(), singles.reset()]
    assert_equal(*states)
    for step in range(steps):
        set_actions(batch, states, rng)
        if step % 3:
            set_mask(states, "_step", torch.from_numpy(rng.random((len(batch.games), 1)) < 0.6))
        states = [env.step(state) for env, state in zip(envs, states, strict=True)]
        assert_equal(*states)
        states = [env._step_mdp(state) for env, state in zip(envs, states, strict=True)]
        wanted = states[0]["done"].clone()
        wanted[1] |= step == steps // 2
        if wanted.any():
            set_mask(states, "_reset", wanted)
            states = [env.reset(state) for env, state in zip(envs, states, strict=True)]
            assert_equal(*states)


def set_actions(batch, states, rng):
    fill_actions(batch, states[0], rng)
    for team in batch.group_map:
        states[1][team, "action"] = states[0][team, "action"].unsqueeze(1)


def set_mask(states, name, mask):
    states[0][name], states[1][name] = mask, mask.unsqueeze(1)
