"""A task is played in a playground, or the configuration refuses the pair with the choices."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from composed import compose
from inspection import start_problems, step_problems
from rollouts import game_cfg
from rude_actions import rude_actions

from veca_marl.config import conf_dir
from veca_marl.envs.core.game import Game

PLAYGROUNDS = sorted(path.stem for path in (conf_dir() / "playground").glob("*.yaml"))
SMALL_EYES = ("senses.vision.width=8", "senses.vision.height=8")
STARTS, STEPS = 20, 5
RANDOM = "random_house"  # which tasks fit it depends on its seed
HOUSES = set(PLAYGROUNDS) - {"simple", "single_room", RANDOM}
REFUSED = {
    "KickTheBall": set(),
    "MultiAgentNav": {"simple", "single_room"},
    "ChaseCar": HOUSES,
    "MazeNav": {*HOUSES, "single_room"},
    "SoccerOnePlayer": HOUSES - {"house", "house2", "two_rooms"} | {"single_room"},
}
CHOICES = re.compile(r"\bplayground=\w+")


@cache
def playground(name):
    return compose(["+task=ObjectNav", f"playground={name}"]).game.playground


def refusal(game):
    """Return why a game is refused; empty if it is not."""
    try:
        game.check_playground()
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.slow
def test_a_misfit_is_refused_with_names_and_choices(task):
    own = game_cfg(task)
    assert not refusal(own)
    for name in PLAYGROUNDS:
        message = refusal(replace(own, playground=playground(name)))
        assert not message or (f"'{name}'" in message and CHOICES.search(message))


@pytest.mark.parametrize(("name", "refused"), REFUSED.items(), ids=REFUSED)
def test_no_other_playgrounds_than_these_are_refused(name, refused):
    own = game_cfg(name)
    places = set(PLAYGROUNDS) - {RANDOM}
    found = {place for place in places if refusal(replace(own, playground=playground(place)))}
    assert found == refused


@pytest.mark.slow
@pytest.mark.parametrize("place", PLAYGROUNDS)
def test_what_is_not_refused_starts_and_steps(task, place):
    cfg = replace(game_cfg(task, "own", *SMALL_EYES), playground=playground(place))
    if refusal(cfg):
        pytest.skip("refused, see the test above")
    game, rng = Game(cfg), np.random.default_rng(0)
    for seed in range(STARTS):
        game.reset(np.random.default_rng(seed))
        assert not start_problems(game)
        for step in range(STEPS):
            assert not step_problems(game, game.step(rude_actions(game.actors, step, rng, 2)))
    game.close()
