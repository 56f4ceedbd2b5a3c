"""MultiAgentNav without vision and touch, and steps of its agents."""

import math

import numpy as np
from composed import compose

from veca_marl.envs.core.game import Game

STEP_S = 0.04
EARS_ALONE = ("senses/vision=blind", "senses/touch=numb")


def game_of(*overrides, agents=2, playground="four_rooms"):
    overrides = [f"task.agents={agents}", f"playground={playground}", *overrides]
    return Game(compose(["+task=MultiAgentNav", *EARS_ALONE, *overrides]).game)


def begin(game, seed=0):
    """Start with all agents far from the object, which is in the middle of a room."""
    game.reset(np.random.default_rng(seed))
    game.task.target.place((0.0, 0.0, 0.2))
    for n, player in enumerate(game.players):
        player.body.place((4.0, 3.0 + 0.6 * n, 0.0))
    game.world.refresh()


def step(game, **commands):
    """Simulate one step; agents without a command stand."""
    commands = {player.name: commands.get(player.name, (0.0, 0.0)) for player in game.players}
    rows = {player.name: player.body.encode(commands[player.name]) for player in game.players}
    return game.step(rows)


def put(game, number, x, y=0.0, yaw_deg=0.0):
    game.players[number].body.place((x, y, 0.0), math.radians(yaw_deg))
    game.world.refresh()


def seconds_needed(game, seed):
    """Let the experts play; return the time until all have arrived, inf if they have not."""
    rng = np.random.default_rng(seed)
    game.reset(rng)
    while True:
        commands = {p.name: game.expert_of(p).act(game.observe(p)) for p in game.players}
        outcome = game.step({p.name: p.body.encode(commands[p.name]) for p in game.players})
        if outcome.done:
            return game.steps * STEP_S if outcome.terminated else math.inf
