"""Helpers for the tests of the tasks with blocks."""

import numpy as np
from composed import compose

from veca_marl.envs.core.game import Game


def blocks_game(task, *overrides):
    """Return a game without vision and touch, which are expensive."""
    unsensed = ("senses/vision=blind", "senses/touch=numb")
    game = Game(compose([f"+task={task}", *unsensed, *overrides]).game)
    game.reset(np.random.default_rng(0))
    return game


def sit(game, seconds):
    """Let the body hold its posture; yield the terms of every step."""
    player = game.players[0]
    posture = player.body.joint_angles()
    for _ in range(round(seconds / game.world.clock.step_s)):
        outcome = game.step({player.name: player.body.encode(posture)})
        yield outcome.terms[player.name]


def play(game, seed):
    """Let the expert play an episode; return the sum of the terms and whether it was solved."""
    player, rng, total, over = game.players[0], np.random.default_rng(seed), {}, False
    game.reset(rng)
    while not over:
        row = player.body.encode(game.expert_of(player).act({}))
        outcome = game.step({player.name: row})
        for name, value in outcome.terms[player.name].items():
            total[name] = total.get(name, 0.0) + value
        over = outcome.done
    return total, game.task.solved(game.players[0])


def sits(game):
    """Return whether the body has not toppled."""
    return game.players[0].body.bone("pelvis").rotation[2, 2] > 0.8
