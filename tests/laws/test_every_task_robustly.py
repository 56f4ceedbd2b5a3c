"""Every task starts from many seeds and survives rude but legal actions.

The quick suite plays a slice of what the nightly suite plays.
"""

import gc

import numpy as np
import pytest
from inspection import observation_problems, resident_mb, start_problems, step_problems
from refusals import naming
from rollouts import game_cfg
from rude_actions import PERIOD, illegal_actions, rude_actions

from veca_marl.checks.starts import digest
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game

STARTS, STEPS = 1000, 20_000
SOME_STARTS, SOME_STEPS = 6, 14  # two steps for each of the `WAYS` of acting
CHECKED_STEPS = 20  # of the used world, which are compared with those of a new one
WARM_STEPS = 4000  # until caches are full and the greatest number of contacts has occurred
MOST_GROWTH_MB = 16.0


def check_starts(game, seeds):
    """Begin an episode from each seed."""
    found = {}
    for seed in seeds:
        game.reset(np.random.default_rng(seed))
        problems = start_problems(game)
        if problems:
            found[seed] = problems
    assert not found


def play_rudely(game, steps, period=PERIOD, observed_every=1):
    """Play episodes of rude actions; return the memory in use after `WARM_STEPS` and at the end."""
    rng, episodes, done = np.random.default_rng(3), Episodes(seed=3), True
    warm_mb = resident_mb()
    for step in range(steps):
        if done:
            game.reset(episodes.next())
        outcome = game.step(rude_actions(game.actors, step, rng, period))
        problems = step_problems(game, outcome)
        if step % observed_every == 0:
            problems += observation_problems(game)
        assert not problems, f"step {step} of the game, {game.steps} of the episode"
        done = outcome.done
        if step == WARM_STEPS:
            warm_mb = collected_mb()
    return warm_mb, collected_mb()


def collected_mb():
    gc.collect()
    return resident_mb()


def check_refusals(game):
    """Give illegal values to the last actor: nothing moves, and the message names it."""
    game.reset(np.random.default_rng(0))
    body, name = game.actors[-1].body, game.actors[-1].name
    before = body.bone_positions()
    for action in illegal_actions(body.action_spec):
        actions = rude_actions(game.actors, 0, np.random.default_rng(0)) | {name: action}
        with pytest.raises(ValueError, match=naming(name, "action")):
            game.step(actions)
    np.testing.assert_array_equal(body.bone_positions(), before)


def test_some_starts_and_rude_steps(own_game):
    check_starts(own_game, range(SOME_STARTS))
    play_rudely(own_game, SOME_STEPS, period=2, observed_every=10)
    check_refusals(own_game)


@pytest.mark.slow
def test_a_thousand_seeds_start(own_game):
    check_starts(own_game, range(STARTS))


@pytest.mark.slow
def test_20_000_rude_steps_leave_the_world_as_it_was(own_game, task):
    warm_mb, end_mb = play_rudely(own_game, STEPS)
    assert end_mb - warm_mb < MOST_GROWTH_MB
    new = Game(game_cfg(task))
    assert digest(own_game, CHECKED_STEPS, seed=5) == digest(new, CHECKED_STEPS, seed=5)
    new.close()
