"""A search over short plans, which branches from snapshots, against the random policy.

``python examples/tree_search.py`` plays both on the same episodes of KickTheBall and prints the
mean return of each.
"""

from __future__ import annotations

import argparse
from statistics import mean

import torch
from tensordict import TensorDictBase

import veca_marl
from veca_marl.extend import VecaEnv

TASK, ACTION, REWARD = "KickTheBall", ("agents", "action"), ("agents", "reward")
AHEAD, TAKEN = 25, 5  # steps of a plan, and steps that are played before the next search


def played(env: VecaEnv, state: TensorDictBase, action: torch.Tensor) -> TensorDictBase:
    """Return the state after a step in which all worlds have their row of an action."""
    following: TensorDictBase = env.step(state.set(ACTION, action.clone()))["next"]
    return following


def searched(env: VecaEnv, episode: int, steps: int) -> float:
    """Return the return of an episode; each world of the environment tries one plan.

    A plan is one action, drawn at random, for the whole second that it looks ahead.
    """
    env.set_seed(episode)
    env.reset()
    now, total = env.snapshot([0])[0], 0.0
    for _ in range(0, steps, TAKEN):
        plans = env.full_action_spec.rand()[ACTION]
        state, values = env.restore(now), torch.zeros(len(plans))
        for _ in range(AHEAD):
            state = played(env, state, plans)
            values += state[REWARD].flatten()
        state, best = env.restore(now), plans[int(values.argmax())].expand_as(plans)
        for _ in range(TAKEN):
            state = played(env, state, best)
            total += float(state[REWARD][0])
        now = env.snapshot([0])[0]
    return total


def random_return(env: VecaEnv, episode: int, steps: int) -> float:
    """Return the return of the random policy in the same episode."""
    env.set_seed(episode)
    state, total = env.reset(), 0.0
    for _ in range(steps):
        state = played(env, state, env.full_action_spec.rand()[ACTION])
        total += float(state[REWARD][0])
    return total


def main() -> None:
    """Play some episodes by both policies."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--steps", type=int, default=150, help="of each episode")
    parser.add_argument("--plans", type=int, default=16, help="branches of each search")
    words = parser.parse_args()
    torch.manual_seed(0)
    env = veca_marl.make(TASK, worlds=words.plans, seed=0)
    for name, play in (("search", searched), ("random", random_return)):
        returns = [play(env, episode, words.steps) for episode in range(words.episodes)]
        print(f"{name}: mean return {mean(returns):.2f}, of each {[round(r, 2) for r in returns]}")
    env.close()


if __name__ == "__main__":
    main()
