"""Runs that learn from demonstrations: what is refused before they begin, and one that is made."""

import csv
import shutil

import pytest
import torch
from composed import compose
from refusals import naming

import veca_marl
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.config import ConfigError, compose_node
from veca_marl.demonstrations import main
from veca_marl.envs.core.task import find_task
from veca_marl.runs.assembly import make_trainer, read_specs
from veca_marl.runs.demonstrations import open_demonstrations
from veca_marl.runs.run_folder import RunFolder

SHORT = ["task.max_seconds=0.4", "senses/vision=blind"]
SMALL = ["collect=one_process", "collect.worlds=2", "collect.steps=32", "eval.every_frames=128"]
SMALL += ["eval.episodes=2", "eval.worlds=2", "threads=1", "log=csv", "log.video=false"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("demonstrations") / "kick"
    words = ["+task=KickTheBall", *SHORT, "episodes=4", "processes=0"]
    assert main([*words, f"to={path}"]) == 0
    return path


def cfg(*words):
    return compose(["+task=KickTheBall", *SHORT, *SMALL, *words])


OTHERS = [
    (("algo=bc",), ("demonstrations=",)),
    (("algo=bc", "demonstrations=nowhere"), ("nowhere", "card.json")),
    (("algo=bc", "demonstrations={}", "body=walker_discrete"), ("discrete",)),
    (("algo=bc", "demonstrations={}", "senses/audio=mono"), ("audio", "hrtf", "mono")),
    (("algo=bc", "demonstrations={}", "clock=agent4ms"), ("25", "steps per second")),
    (("algo=bc", "demonstrations={}", "intrinsic=rnd"), ("bc", "intrinsic")),
    (("algo=ppo", "demonstrations={}", "body=walker_voice"), ("body",)),
    (("algo=bc", "demonstrations={}", "algo.batch_size=4096", "total_frames=99"), ("4096",)),
]


@pytest.mark.parametrize(("words", "named"), OTHERS, ids=str)
def test_what_does_not_fit_is_refused_in_one_line(folder, words, named):
    with pytest.raises(ConfigError, match=naming(*named)):
        make_trainer(cfg(*(word.format(folder) for word in words)))


def test_demonstrations_of_another_task_are_refused(folder):
    words = ["+task=MoveToTarget", "algo=bc", f"demonstrations={folder}"]
    with pytest.raises(ConfigError, match=naming("KickTheBall", "MoveToTarget")):
        make_trainer(compose(words))


def test_an_expert_that_lacks_a_sense_cannot_label():
    words = ["+task=KickTheBall", "senses/audio=deaf", "algo=dagger", *SMALL]
    with pytest.raises(ConfigError, match=naming("dagger", "audio")):
        make_trainer(compose([*words, "algo.replay.warm_up_frames=64"]))


def test_rewards_are_those_of_the_weights_of_the_run(folder):
    stored = Demonstrations(folder).rows["agents"]
    run = cfg("task.weights.approach=3.0", "task.weights.kick=0.0")
    found = open_demonstrations(str(folder), run.game, read_specs(run.game), ["agents"])
    weights = find_task("KickTheBall").step_weights(run.game.task, run.game.clock)
    wanted = sum(weight * stored["info", name] for name, weight in weights.items())
    assert weights["approach"] == 3.0
    assert (wanted - stored["reward"]).abs().max() > 1e-3
    torch.testing.assert_close(found.rows["agents", "reward"], wanted)


def test_rewards_of_the_same_weights_are_those_recorded(folder):
    run = cfg()
    found = open_demonstrations(str(folder), run.game, read_specs(run.game), ["agents"])
    stored = Demonstrations(folder).rows["agents", "reward"]
    torch.testing.assert_close(found.rows["agents", "reward"], stored)


def test_a_resumed_run_does_not_learn_from_other_demonstrations(folder, tmp_path):
    extended, run = tmp_path / "extended", RunFolder(tmp_path / "run")
    shutil.copytree(folder, extended)
    words = ["+task=KickTheBall", *SHORT, *SMALL, "algo=bc", f"demonstrations={extended}"]
    run.begin(compose_node(words), words)
    resumed = compose([*words, f"resume={run.path}"])
    make_trainer(resumed, run)
    assert main(["+task=KickTheBall", *SHORT, "episodes=5", "processes=0", f"to={extended}"]) == 0
    with pytest.raises(ConfigError, match=naming(str(extended), "5 episodes")):
        make_trainer(resumed, run)
    make_trainer(compose(words), RunFolder(tmp_path / "other"))


@pytest.mark.slow
def test_ppo_starts_from_a_cloned_policy(folder, tmp_path):
    words = [*SHORT, *SMALL, "algo.batch_size=32", "algo=bc", f"demonstrations={folder}"]
    cloned = veca_marl.train(
        "KickTheBall", total_frames=256, folder=tmp_path / "bc", overrides=words
    )
    assert [row["frames"] for row in cloned.metrics] == [64, 128, 192, 256]
    with (tmp_path / "bc" / "metrics.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["agents/imitation_loss"]) < float(rows[0]["agents/imitation_loss"])
    assert "agents/return" not in rows[0]
    started = veca_marl.train(
        "KickTheBall",
        total_frames=256,
        folder=tmp_path / "ppo",
        overrides=[*SHORT, *SMALL, f"init_from.agents={tmp_path / 'bc'}"],
    )
    assert started.folder is not None
