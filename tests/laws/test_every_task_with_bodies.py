"""A task is played with a body, or the configuration refuses the pair with the choices."""

import re
from dataclasses import replace
from functools import cache

import pytest
from composed import compose
from refusals import naming
from rollouts import game_cfg

from veca_marl.config import ConfigError
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import find_task
from veca_marl.plugins import conf_dir
from veca_marl.sim.body import BodyCfg

BODIES = sorted(path.stem for path in (conf_dir() / "body").glob("*.yaml"))
CHOICES = re.compile(r"^agents\b.*\bbody(=\w+|\.verbs=\[)")
CHEAPEST = ("walker", "mitten")  # one of each kind
WALKERS = {name for name in BODIES if name.startswith("walker")}
# tasks for all bodies, for bodies with joints, for bodies that walk, and for those that grab
REFUSED = {
    "ObjectNav": set(),
    "PushOut1v1": set(),
    "GrabObject": WALKERS,
    "KickTheBall": set(BODIES) - WALKERS,
    "ColorSort": set(BODIES) - {"walker_carry", "walker_verbs", "walker_discrete_verbs"},
}


@cache
def body(name):
    return compose(["+task=ObjectNav", f"body={name}"]).game.body


def refusal(task, name):
    """Return why a body is refused, when a configuration of `game_cfg` is changed; or nothing."""
    try:
        replace(game_cfg(task), body=body(name)).check_bodies()
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.slow
def test_a_misfit_is_refused_with_the_kind_of_body_or_the_verbs_that_are_needed(task):
    game_cfg(task).check_bodies()
    for name in BODIES:
        assert not (message := refusal(task, name)) or CHOICES.search(message)


@pytest.mark.parametrize(("name", "refused"), REFUSED.items(), ids=REFUSED)
def test_no_other_bodies_than_these_are_refused(name, refused):
    assert {body for body in BODIES if refusal(name, body)} == refused


def test_no_game_is_built_with_a_body_that_is_refused(task):
    refused = {name: message for name in CHEAPEST if (message := refusal(task, name))}
    rules = find_task(task)  # `walker` has no verbs
    assert len(refused) == (rules.body_cfg is not BodyCfg) + bool(rules.verbs)
    for name, message in refused.items():
        with pytest.raises(ValueError, match=re.escape(message)):
            Game(replace(game_cfg(task), body=body(name)))


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_what_is_not_refused_is_built(task, name):
    if refusal(task, name):
        pytest.skip("refused, see the tests above")
    game = Game(replace(game_cfg(task), body=body(name), team={}))
    assert {type(player.body).cfg_type for player in game.players} == {type(body(name))}
    game.close()


@pytest.mark.parametrize("overrides", [["body=walker"], ["seed=1", "body=walker_voice"]])
def test_a_configuration_with_another_kind_of_body_is_refused(overrides):
    with pytest.raises(ConfigError, match=naming("agents", "joints", "body=full")):
        compose(["+task=GrabObject", *overrides])


def test_the_body_of_a_task_without_kicks_need_not_kick():
    with pytest.raises(ConfigError, match=naming("agents", "body=walker")):
        compose(["+task=MazeNav", "body=full"])
