"""The public functions of `veca_marl`."""

from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import naming

import veca_marl
from veca_marl import api
from veca_marl.algos.evaluation.evaluate import random_policy
from veca_marl.algos.networks.encoders import Precision
from veca_marl.api import as_integer
from veca_marl.config import ConfigError
from veca_marl.config.choices import GameChoices, choose
from veca_marl.envs.core.game_cfg import Script
from veca_marl.override_text import quoted
from veca_marl.runs.episode_page import read_page
from veca_marl.runs.run_folder import RunFolder

TINY = ["collect=one_process", "collect.worlds=1", "collect.steps=32", "algo.minibatches=2"]
TINY += ["log=silent", "eval.episodes=1", "eval.worlds=1", "task.max_seconds=0.4"]
BLIND = {"vision": "blind"}
FOLDER = Path(__file__).parent


def test_every_public_name_exists():
    for name in veca_marl.__all__:
        assert getattr(veca_marl, name) is not None


def test_train_returns_metrics_and_a_policy_and_stores_the_run(tmp_path):
    result = veca_marl.train(
        "KickTheBall", total_frames=64.0, senses=BLIND, folder=tmp_path / "run", overrides=TINY
    )
    assert [row["frames"] for row in result.metrics] == [32, 64]
    assert {row["team"] for row in result.evaluations} == {"agents"}
    stored = RunFolder(tmp_path / "run").typed_config()
    assert stored.total_frames == 64
    assert stored.algo.network.precision is Precision.auto.on(torch.device("cpu"))
    env = veca_marl.make("KickTheBall", senses=BLIND, seed=0)
    assert "action" in result.policy(env.reset())["agents"]
    env.close()
    with pytest.raises(ConfigError, match=naming(tmp_path / "run", "resume=")):
        veca_marl.train("KickTheBall", folder=tmp_path / "run", senses=BLIND, overrides=TINY)


def test_train_stays_a_function_after_the_module_of_the_command_was_imported():
    assert import_module("veca_marl.train") is veca_marl.train
    with pytest.raises(ConfigError, match=naming("'Chess'", "BabyzumasRevenge", "KickTheBall")):
        veca_marl.train("Chess")


@pytest.mark.parametrize("suite", [["veca"], None, 3])
def test_a_suite_is_a_name(suite):
    with pytest.raises(ValueError, match=naming(suite, "babybench", "veca")):
        veca_marl.list_tasks(suite=suite)


def test_choices_are_shown_as_arguments():
    """Also to `help` and to the completion of notebooks."""
    functions = [api.make, api.gym_env, api.parallel_env, api.train, api.check_task]
    for function in functions:
        shown = signature(function).parameters
        assert set(GameChoices.__annotations__) < set(shown)
        assert all(one.kind is not Parameter.VAR_KEYWORD for one in shown.values())


@pytest.mark.parametrize("function", [veca_marl.make, veca_marl.train])
def test_an_argument_that_does_not_exist_is_refused_with_those_that_do(function):
    with pytest.raises(TypeError, match=naming("sense", "senses", "development", "overrides")):
        function("KickTheBall", sense={})


def test_an_age_is_an_argument():
    grown = veca_marl.make("KickTheBall", development=8)
    told = veca_marl.make("KickTheBall", overrides=["development=8"])
    assert grown.games[0].cfg == told.games[0].cfg
    with pytest.raises(ConfigError, match=naming("80", "36")):
        veca_marl.make("KickTheBall", development=80)


def test_an_environment_says_what_it_is_and_where_its_tensors_are():
    env = veca_marl.make("PushOut2v2", worlds=2, senses={"vision": "blind"}, device="cpu")
    for part in ("PushOut2v2", "worlds=2", "red x 2", "blue x 2", "touch", "joints (40,)"):
        assert part in repr(env)
    assert env.rollout(2).device == torch.device("cpu")
    assert ("red", "mask") in env.observation_keys
    assert not any("info" in key for key in env.observation_keys)
    assert ("red", "info") in env.rollout(2)["next"].keys(True)
    env.close()


@pytest.mark.parametrize("layout", ["arrays", "flat"])
def test_environments_of_other_libraries_say_what_they_are(layout):
    single = veca_marl.gym_env("KickTheBall", senses={"vision": "blind"}, layout=layout)
    several = veca_marl.parallel_env("PushOut2v2", senses={"vision": "blind"}, layout=layout)
    for env, parts in (
        (single, ("KickTheBall", "agents x 1", "audio", "move (2,)")),
        (several, ("PushOut2v2", "red x 2", "blue x 2", "touch", "joints (40,)")),
    ):
        assert all(part in repr(env) for part in parts)
        env.close()


def test_fractions_of_frames_are_refused():
    with pytest.raises(ConfigError, match=naming("total_frames=1.5")):
        veca_marl.train("KickTheBall", total_frames=1.5)


@pytest.mark.parametrize("number", [1e6, 2**53 + 1, np.int64(2**53 + 1), np.float32(4.0)])
def test_integral_numbers_keep_all_their_digits(number):
    """A seed above 2^53 is not the nearest float."""
    found = as_integer("seed", number)
    assert type(found) is int
    assert found == number


def close_of_closed():
    env = veca_marl.make("KickTheBall", senses=BLIND)
    env.close()
    env.reset()


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (lambda: veca_marl.list_tasks("babybench"), ("plugins='babybench'",)),
        (lambda: veca_marl.make("KickTheBall", plugins="mine"), ("plugins='mine'",)),
        (lambda: veca_marl.make("KickTheBall", overrides="seed=3"), ("overrides='seed=3'",)),
        (
            lambda: veca_marl.make("KickTheBall", overrides=[3]),
            ("overrides=[3]",),
        ),
        (
            lambda: veca_marl.make("KickTheBall", overrides=["task=MazeNav"]),
            ("overrides", "'task=MazeNav'", "`task`"),
        ),
        (
            lambda: veca_marl.train("KickTheBall", overrides=["seed=3"]),
            ("overrides", "'seed=3'", "`seed`"),
        ),
        (
            lambda: veca_marl.train("KickTheBall", overrides=["hydra.run.dir=x"]),
            ("overrides", "'hydra.run.dir=x'", "`folder`"),
        ),
        (
            lambda: veca_marl.train("KickTheBall", total_frames=9, overrides=["total_frames=8"]),
            ("overrides", "'total_frames=8'", "`total_frames`"),
        ),
        (lambda: veca_marl.check_task("KickTheBall", checks=5), ("checks=5", "CheckCfg")),
        (
            lambda: veca_marl.make("KickTheBall", overrides=["seed=3"]),
            ("overrides", "'seed=3'", "`seed`"),
        ),
        (
            lambda: veca_marl.gym_env("KickTheBall", overrides=["algo/network=memory"]),
            ("overrides", "'algo/network=memory'", "body", "clock", "opponent"),
        ),
        (
            lambda: veca_marl.parallel_env("PushOut1v1", overrides=["+algo@learner.red=mappo"]),
            ("overrides", "'+algo@learner.red=mappo'", "playground"),
        ),
        (
            lambda: veca_marl.check_task("KickTheBall", overrides=["total_frames=1e6"]),
            ("overrides", "'total_frames=1e6'", "playground"),
        ),
        (
            lambda: veca_marl.gym_env("PushOut1v1", overrides=[f"opponent.blue={quoted(FOLDER)}"]),
            (f"opponent.blue={FOLDER}", "idle", "random"),
        ),
        (lambda: veca_marl.make("KickTheBall", senses="mono"), ("senses='mono'",)),
        (lambda: veca_marl.make(3), ("task=3",)),
        (lambda: veca_marl.make("KickTheBall", worlds=2.5), ("worlds=2.5",)),
        (lambda: veca_marl.make("KickTheBall", worlds=0), ("worlds=0",)),
        (lambda: veca_marl.make("KickTheBall", seed="a"), ("seed='a'",)),
        (lambda: veca_marl.make("KickTheBall", device="gpu7"), ("device=gpu7", "cpu")),
        (
            lambda: veca_marl.train("KickTheBall", total_frames="many"),
            ("total_frames='many'",),
        ),
        (lambda: veca_marl.train("KickTheBall", folder=__file__), (__file__,)),
        (lambda: veca_marl.check_task(3), ("task=3", "registered")),
        (close_of_closed, ("environment",)),
    ],
)
def test_wrong_arguments_are_named(call, parts):
    with pytest.raises((ValueError, RuntimeError), match=naming(*parts)):
        call()


@pytest.mark.parametrize("script", ["idle", "random"])
def test_overrides_of_every_part_of_the_game_have_effect(script):
    overrides = ["task.max_seconds=0.4", "body=walker_discrete", "senses/touch=numb"]
    overrides += ["playground=simple", "clock.control_rate_hz=10", "clock.substeps=12"]
    overrides += ["+body@team.red.body=walker", f"opponent.blue={script}", "plugins=[]"]
    game = choose("PushOut1v1", senses=BLIND, overrides=overrides)
    assert (game.task.max_seconds, game.clock.control_rate_hz) == (0.4, 10)
    assert game.body_of("red") != game.body_of("blue")
    assert game.script == {"blue": Script(script)}


def test_an_episode_is_saved_as_a_page(tmp_path):
    """By the policy that `train` returns, too: it plays what it has learnt."""
    env = veca_marl.make("KickTheBall", senses=BLIND, seed=0)
    policy = random_policy(env)
    env.close()
    short = {"senses": BLIND, "overrides": ["task.max_seconds=0.8"]}
    path = veca_marl.save_episode(
        tmp_path / "a.html", "KickTheBall", policy=policy, longest_s=0.4, **short
    )
    episode = read_page(path)
    assert episode.steps == 10
    assert episode.is_cut
    assert episode.agents[0].pictures is None
    with pytest.raises(ConfigError, match=naming("a.htm", ".html")):
        veca_marl.save_episode("a.htm", "KickTheBall")
    with pytest.raises(ConfigError, match=naming("longest_s", "0")):
        veca_marl.save_episode(tmp_path / "b.html", "KickTheBall", longest_s=0.0)
