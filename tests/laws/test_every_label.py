"""Laws of the labels of every expert, while others act."""

from contextlib import closing

import torch
from rollouts import game_cfg
from tensordict import TensorDict
from torchrl.envs.utils import step_mdp

from veca_marl.envs.adapters.torchrl.labelled import LABEL, LabelledEnv

WORLDS, STEPS, SEED = 2, 20, 3


def labels(game, teams, worlds, first_world=0):
    """Return the labels of all teams while every agent takes the action of zeros."""
    found = []
    with closing(LabelledEnv(game, worlds, SEED, teams=teams, first_world=first_world)) as env:
        state = env.reset()
        for _ in range(STEPS):
            label = TensorDict({t: state[t, LABEL].clone() for t in env.group_map}, [worlds])
            for team in env.group_map:
                assert env.full_action_spec[team, "action"].is_in(label[team])
                state[team, "action"] = env.full_action_spec[team, "action"].zero()
            found.append(label)
            state = step_mdp(env.step(state))
    return torch.stack(found, 1)


def test_labels_are_actions_and_those_of_a_batch_are_those_of_single_worlds(task):
    game = game_cfg(task, "own")
    teams = [team.name for team in game.teams if team.name not in game.script]
    batch = labels(game, teams, WORLDS)
    for world in range(WORLDS):
        assert (labels(game, teams, 1, world) == batch[world : world + 1]).all()
