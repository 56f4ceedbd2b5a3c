"""Games of walkers without vision and touch, for the tests of PushOut and Soccer."""

import numpy as np
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script

FAST = ("senses/vision=blind", "senses/touch=numb")
WALKING = ("body=walker", "task.max_seconds=20")


def game_of(task, *overrides, seed=0):
    """Return a game of walkers, or of what `overrides` choose."""
    chosen = {override.partition("=")[0] for override in overrides}
    walking = [word for word in WALKING if word.partition("=")[0] not in chosen]
    game = Game(compose([f"+task={task}", *FAST, *walking, *overrides]).game)
    game.reset(np.random.default_rng(seed))
    return game


def steps(game, rng, **scripts):
    """Play an episode with one script per team; yield every outcome."""
    over = False
    while not over:
        for player in game.players:
            game.play_script(player, Script[scripts[player.team]])
        outcome = game.advance()
        yield outcome
        over = outcome.done


def episodes(game, count, **scripts):
    """Yield the list of outcomes of each of several episodes."""
    for seed in range(count):
        rng = np.random.default_rng([2026, seed])
        game.reset(rng)
        yield list(steps(game, rng, **scripts))


def total_reward(game, outcome):
    return sum(game.reward_of(terms) for terms in outcome.terms.values())


def rest(game, seconds=0.04):
    """Let all players rest for a time; return the outcomes."""
    outcomes = []
    for _ in range(round(seconds / 0.04)):
        for player in game.players:
            player.body.rest()
        outcomes.append(game.advance())
    return outcomes
