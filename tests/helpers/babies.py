"""Help for the tests of the tasks in which a child learns to move."""

from contextlib import contextmanager

import numpy as np
import pytest

from veca_marl.config import compose
from veca_marl.envs.core.game import Game

BODIES = ("mitten_limbs", "mitten_position")


@contextmanager
def child_game(task, *overrides):
    """Lend a game that feels no touch, which is dear and read by nobody here."""
    game = Game(compose([f"+task={task}", "senses/touch=numb", *overrides]).game)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


def zero_action(body):
    """Return zeros for all parts of a body's action."""
    return {part: np.zeros(spec.shape, spec.dtype) for part, spec in body.action_spec.items()}


def rest(game):
    """Let the child be limp for a step; return the outcome."""
    player = game.players[0]
    limp = zero_action(player.body)
    return game.step({player.name: limp})


def hold(game, angles):
    """Let the child pull its joints to angles for a step; return the outcome."""
    player = game.players[0]
    return game.step({player.name: player.body.encode(angles)})


def put(game, posture):
    """Begin an episode in a posture; return the body."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.7, posture)
    return body


def terms_at_rest(game, posture):
    """Return the terms of one limp step in a posture."""
    put(game, posture)
    return rest(game).terms["agents"]


def starts(game, count):
    """Begin as many episodes, from seed 0 on; yield the body each time."""
    for seed in range(count):
        game.reset(np.random.default_rng(seed))
        yield game.players[0].body


def play(game, rng):
    """Let the expert play an episode; return all outcomes and how many metres it got ahead."""
    game.reset(rng)
    player, outcomes = game.players[0], []
    start, heading = player.body.position, player.body.forward
    while not (outcomes and outcomes[-1].done):
        row = player.body.encode(game.expert_of(player).act({}))
        outcomes.append(game.step({player.name: row}))
    return outcomes, (player.body.position - start) @ heading


def check_limbs_fall_and_none_flies(game):
    """Nothing is thrown by the start: half a second of rest stays slow."""
    for _ in range(12):
        outcome = rest(game)
        body = game.players[0].body
        assert np.linalg.norm(body.velocities(), axis=1).max() < 2.5
    return outcome


def check_walkers_are_refused(task):
    with pytest.raises(ValueError, match="body with joints"), child_game(task, "body=walker"):
        pass
