"""Rollouts that the laws compare: of random actions and of scripts, and their digests.

As a program it prints the digest of a rollout of each task named, to compare processes.
"""

import hashlib
import sys
from dataclasses import replace

import numpy as np
import torch
from composed import compose

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, random_action
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.body import VoiceKind
from veca_marl.sim.body.walker import WalkerCfg

# episodes of 10 steps
SHORT, EPISODE = "task.max_seconds=0.4", 10
# kinds of actions in a task: those of its own body, and of another one
KINDS = ("own", "other")
# tasks of joint-level bodies that walkers can play as well
CONTESTS = ("PushOut1v1", "PushOut2v2", "SoccerOnePlayer", "SoccerTwoPlayer")


def game_cfg(task, kind="own", *overrides):
    """Return the game of a task with its own body, or with one that has other actions."""
    own = compose([f"+task={task}", *overrides])
    if kind == "own":
        return own.game
    return compose([f"+task={task}", f"body={other_body(task, own.game.body)}", *overrides]).game


def other_body(task, own):
    if task in CONTESTS:
        return "walker"
    if not isinstance(own, WalkerCfg):
        return "mitten_position"
    if own.verbs:
        return "walker_discrete_verbs"
    # where players call, the house is silent without voices: the ears would be constant
    return "walker_discrete" if own.voice is VoiceKind.silent else "walker_discrete_voice"


def play(env, steps, seed):
    """Seed an env, play random actions drawn with numpy, return all steps as one TensorDict."""
    env.set_seed(seed)
    rng = np.random.default_rng(seed)
    state, steps_played = env.reset(), []
    for _ in range(steps):
        fill_actions(env, state, rng)
        played, state = env.step_and_maybe_reset(state)
        steps_played.append(played.clone())
    return torch.stack(steps_played, -1)


def fill_actions(env, state, rng):
    for team, names in env.group_map.items():
        spec = env.games[0].team(team)[0].body.action_spec
        rows = [[random_action(spec, rng) for _ in names] for _ in env.games]
        for part in spec:
            key = (team, "action") if len(spec) == 1 else (team, "action", part)
            state[key] = torch.from_numpy(np.array([[row[part] for row in r] for r in rows]))


def digest(rollout):
    """Return a hash of every byte of a TensorDict."""
    total = hashlib.sha256()
    leaves = rollout.items(include_nested=True, leaves_only=True)
    for key, value in sorted(leaves, key=lambda item: str(item[0])):
        total.update(str(key).encode())
        total.update(value.contiguous().numpy().tobytes())
    return total.hexdigest()


def returns(cfg, episodes, script, seed=0):
    """Play episodes and return the return of the first team in each, mean over its players.

    Other teams take random actions, because between two equal teams neither is better.

    Args:
        cfg: The game.
        episodes: Number of episodes.
        script: How the actions of the first team are chosen.
        seed: Seed of all randomness.
    """
    others = {team.name: Script.random for team in cfg.teams[1:]}
    game, stream = Game(replace(cfg, script=others)), Episodes(seed)
    found = []
    for _ in range(episodes):
        game.reset(stream.next())
        total, done = 0.0, False
        while not done:
            for player in game.actors:
                game.play_script(player, script)
            outcome = game.advance()
            total += float(np.mean([game.reward_of(outcome.terms[p.name]) for p in game.actors]))
            done = outcome.done
        found.append(total)
    game.close()
    return np.array(found)


def digests(tasks, steps, seed):
    """Return for each task its name and the digest of a rollout in one world."""
    found = []
    for task in tasks:
        env = VecaEnv(game_cfg(task), worlds=1, seed=0)
        found.append(f"{task} {digest(play(env, steps, seed))}")
        env.close()
    return found


if __name__ == "__main__":
    n_steps, start, *names = sys.argv[1:]
    print(*digests(names, int(n_steps), int(start)), sep="\n")  # noqa: T201  its answer
