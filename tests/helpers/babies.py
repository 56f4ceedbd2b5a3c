"""Helpers for the tests of motor skills."""

from contextlib import contextmanager

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game

BODIES = ("mitten_limbs", "mitten_position")


@contextmanager
def child_game(task, *overrides):
    """Yield a game without touch, which is expensive and not needed here."""
    game = Game(compose([f"+task={task}", "senses/touch=numb", *overrides]).game)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


def zero_action(body):
    """Return zeros for all parts of a body's action."""
    return {part: np.zeros(spec.shape, spec.dtype) for part, spec in body.action_spec.items()}


def rest(game):
    """Simulate a step without torques; return the outcome."""
    player = game.players[0]
    limp = zero_action(player.body)
    return game.step({player.name: limp})


def hold(game, angles):
    """Simulate a step with target angles; return the outcome."""
    player = game.players[0]
    return game.step({player.name: player.body.encode(angles)})


def put(game, posture):
    """Start an episode in a posture; return the body."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.7, posture)
    return body


def terms_at_rest(game, posture):
    """Return the terms of one step without torques in a posture."""
    put(game, posture)
    return rest(game).terms["agents"]


def starts(game, count):
    """Start episodes with seeds 0, 1, ...; yield the body of each."""
    for seed in range(count):
        game.reset(np.random.default_rng(seed))
        yield game.players[0].body


def play(game, rng):
    """Let the expert play an episode; return all outcomes and the distance covered forwards."""
    game.reset(rng)
    player, outcomes = game.players[0], []
    start, heading = player.body.position, player.body.forward
    while not (outcomes and outcomes[-1].done):
        row = player.body.encode(game.expert_of(player).act({}))
        outcomes.append(game.step({player.name: row}))
    return outcomes, (player.body.position - start) @ heading


def check_limbs_fall_and_none_flies(game):
    """All velocities stay small for half a second after the start."""
    for _ in range(12):
        outcome = rest(game)
        body = game.players[0].body
        assert np.linalg.norm(body.velocities(), axis=1).max() < 2.5
    return outcome


def check_walkers_are_refused(task):
    with pytest.raises(ValueError, match="body with joints"), child_game(task, "body=walker"):
        pass
