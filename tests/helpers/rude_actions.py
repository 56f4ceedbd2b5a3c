"""Actions that are legal and as unfavourable as the specification of a body permits."""

from itertools import cycle, islice

import numpy as np

from veca_marl.envs.core.game import random_action

PERIOD = 25  # steps for which a player keeps a way of acting


def anything(spec, step, rng):
    """Draw all values uniformly."""
    return random_action(spec, rng)


def corners(spec, step, rng):
    """Set every number to one of its bounds at random."""
    return _filled(spec, lambda one: rng.choice([one.low, one.high], one.shape))


def bang_bang(spec, step, rng):
    """Set all values to one bound, and to the other in the next step."""
    return _filled(spec, lambda one: one.high if step % 2 else one.low)


def lowest(spec, step, rng):
    """Keep all values at their lower bound."""
    return _filled(spec, lambda one: one.low)


def highest(spec, step, rng):
    """Keep all values at their upper bound."""
    return _filled(spec, lambda one: one.high)


def in_turn(spec, step, rng):
    """Choose each verb in turn, while moving at random; one number of a vector after the other."""
    drawn = random_action(spec, rng)
    for part, one in spec.items():
        if one.is_discrete:
            drawn[part] = np.asarray(step % len(one.names), one.dtype)
        else:
            drawn[part][step % len(one.names)] = one.high
    return drawn


def stillness(spec, step, rng):
    """Keep all numbers at 0 and choose the first of all choices."""
    return _filled(spec, lambda one: 0)


WAYS = (anything, bang_bang, corners, highest, in_turn, lowest, stillness)


def rude_actions(players, step, rng, period=PERIOD):
    """Return an action for each player; after `period` steps each acts as its neighbour did.

    Args:
        players: The players that act.
        step: Number of the step, from 0.
        rng: Source of all random numbers.
        period: Steps for which a player keeps a way of acting.
    """
    ways = islice(cycle(WAYS), step // period % len(WAYS), None)
    return {
        player.name: way(player.body.action_spec, step, rng)
        for player, way in zip(players, ways, strict=False)
    }


def illegal_actions(spec):
    """Yield actions with one part that is not finite, or is no choice."""
    rng = np.random.default_rng(0)
    for part, one in spec.items():
        wrong = [one.high + 1, -1] if one.is_discrete else [np.nan, np.inf, 1.5]
        for value in wrong:
            yield random_action(spec, rng) | {part: np.full(one.shape, value, one.dtype)}


def _filled(spec, value):
    return {
        part: np.broadcast_to(value(one), one.shape).astype(one.dtype) for part, one in spec.items()
    }
