"""A package outside this repository adds a task and a preset: by name, and by its entry point."""

import importlib
import os
import pickle
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from refusals import naming

from veca_marl import api
from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS, Task, TaskCfg, register_task
from veca_marl.plugins import PLUGINS, load_plugins
from veca_marl.runs.assembly import GameFactory
from veca_marl.runs.run_folder import open_run
from veca_marl.sim.body.action import VoiceKind
from veca_marl.sim.body.walker import WalkCommand
from veca_marl.sim.physics.interactions import INTERACTIONS

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "examples" / "plugin"
NAME = "plugins=[veca_marl_beacon]"
BEACON = "+task=FindBeacon"
SHORT = ["log=silent", "collect=one_process", "collect.worlds=1", "collect.steps=64"]
SHORT += ["algo.minibatches=2", "total_frames=128", "eval.episodes=1", "task.max_seconds=1.0"]


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """A folder from which packages can be imported; what they register is removed afterwards."""
    tasks, plugins, modules = set(TASKS), set(PLUGINS), set(sys.modules)
    verbs = set(INTERACTIONS)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for registry, before in ((TASKS, tasks), (PLUGINS, plugins), (INTERACTIONS, verbs)):
        for name in set(registry) - before:
            del registry[name]
    for name in set(sys.modules) - modules:
        if name.partition(".")[0] in {path.name for path in tmp_path.iterdir()}:
            del sys.modules[name]


@pytest.fixture
def example(outside):
    (outside / "veca_marl_beacon").symlink_to(EXAMPLE / "veca_marl_beacon")


def write_package(folder, name, text):
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text(text)


def task_text(name):
    return (
        "from veca_marl.envs.core.task import Task, register_task\n"
        f"@register_task\nclass {name}(Task):\n"
        "    senses = ('proprioception',)\n"
        "    def build(self): ...\n"
        "    def reset(self, rng): ...\n"
        "    def reward(self, player): return {}\n"
    )


def test_a_task_without_a_file_and_a_preset_are_found(example):
    cfg = compose([NAME, BEACON, "senses/vision=short_sighted", "task.reach_m=0.5"])
    assert type(cfg.task).__name__ == "FindBeaconCfg"
    assert (cfg.task.reach_m, cfg.senses.vision.blur_deg) == (0.5, 2.0)
    assert cfg.plugins == ["veca_marl_beacon"]


def test_an_interaction_of_a_plugin_is_a_verb_that_a_reset_undoes(example):
    game = Game(compose([NAME, BEACON, "body=walker_switch"]).game)
    player = game.players[0]
    assert player.body.action_spec["verb"].names == ("none", "switch_off")
    command = WalkCommand(0.0, 0.0, verb="switch_off")
    for _ in range(2):
        game.reset(np.random.default_rng(0))
        beacon = game.task.beacon
        beacon.place((1.0, 0.0, 0.3))
        player.body.place((0.0, 0.0, 0.0))
        game.world.refresh()
        refused = []
        for _ in range(2):
            outcome = game.step({player.name: player.body.encode(command)})
            refused.append(outcome.bodies[player.name]["refused_verbs"])
        assert beacon.sound.muted
        assert refused == [0.0, 1.0]
    game.close()


def test_a_class_is_checked_with_the_preset_of_its_package(outside, monkeypatch):
    write_package(outside, "preset_plugin", task_text("Presetted"))
    (outside / "preset_plugin" / "conf" / "task").mkdir(parents=True)
    (outside / "preset_plugin" / "conf" / "task" / "Presetted.yaml").write_text(
        "# @package _global_\n"
        "defaults: [/schema/task@task: Presetted, override /body: walker_voice, _self_]\n"
        "task: {name: Presetted, max_seconds: 3.0}\n"
    )
    task = importlib.import_module("preset_plugin").Presetted
    checked = []
    monkeypatch.setattr(api, "check_game", lambda cfg, checks: checked.append(cfg))
    api.check_task(task)
    assert checked[0].task.max_seconds == 3.0
    assert checked[0].body.voice is VoiceKind.calls


def test_a_task_that_needs_a_voice_refuses_bodies_without_one(outside):
    text = task_text("Speaking").replace("    senses", "    needs_voice = True\n    senses")
    write_package(outside, "speaking_plugin", text)
    words = ["plugins=[speaking_plugin]", "+task=Speaking"]
    with pytest.raises(ConfigError, match=naming("agents", "voice", "walker_voice")):
        compose([*words, "body=walker"])
    for body in ("walker_voice", "mitten_voice"):
        assert compose([*words, f"body={body}"]).task.name == "Speaking"


def test_an_unknown_task_lists_those_of_plugins_too(example):
    with pytest.raises(ConfigError, match=naming("FindBeacn", "FindBeacon", "KickTheBall")):
        compose([NAME, "+task=FindBeacn"])


def test_a_package_that_does_not_exist_is_named_with_the_reason():
    with pytest.raises(ConfigError, match=naming("plug-in", "'no_such'", "No module")):
        compose(["plugins=[no_such]", "+task=KickTheBall"])


def test_a_package_that_fails_is_named_with_the_reason(outside):
    write_package(outside, "broken_plugin", "raise RuntimeError('no\\nlicence')")
    with pytest.raises(ConfigError, match=naming("'broken_plugin'", "RuntimeError: no licence")):
        compose(["plugins=[broken_plugin]", "+task=KickTheBall"])


def test_a_task_name_that_is_taken_names_both_definitions(outside):
    write_package(outside, "rival_plugin", task_text("KickTheBall"))
    parts = ("'KickTheBall'", "kick_the_ball", "rival_plugin.KickTheBall")
    with pytest.raises(ConfigError, match=naming(*parts)):
        compose(["plugins=[rival_plugin]", "+task=KickTheBall"])


def test_a_configuration_file_that_is_taken_names_both_files(outside):
    write_package(outside, "copying_plugin", "")
    (outside / "copying_plugin" / "conf" / "playground").mkdir(parents=True)
    (outside / "copying_plugin" / "conf" / "playground" / "simple.yaml").write_text("name: mine\n")
    with pytest.raises(ConfigError, match=naming("playground/simple.yaml", "copying_plugin")):
        compose(["plugins=[copying_plugin]", "+task=KickTheBall"])


def test_a_declared_folder_that_is_missing_is_refused(outside):
    write_package(outside, "folderless_plugin", "CONF_DIR = '/no/such/folder'")
    with pytest.raises(
        ConfigError, match=naming("folderless_plugin", "CONF_DIR", "/no/such/folder")
    ):
        compose(["plugins=[folderless_plugin]", "+task=KickTheBall"])


def test_a_plugin_is_loaded_once(example):
    load_plugins(["veca_marl_beacon"])
    load_plugins(["veca_marl_beacon"])
    assert list(PLUGINS) == ["veca_marl_beacon"]


@pytest.fixture
def installed(tmp_path):
    """The environment of a process in which the example is installed."""
    folder = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(folder), str(EXAMPLE)], check=True)
    return {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}


@pytest.mark.slow
def test_an_installed_plugin_needs_no_naming_and_trains(installed, tmp_path):
    """In one process: its task is listed, is made by Gymnasium, and is trained by the command."""
    program = (
        "import sys, veca_marl, gymnasium;"
        "assert 'FindBeacon' in veca_marl.list_tasks();"
        "env = gymnasium.make('veca_marl/FindBeacon-v0', senses={'vision': 'blind'});"
        "env.reset(seed=0); print(env.step(env.action_space.sample())[1]);"
        "from veca_marl.train import main; main()"
    )
    words = [BEACON, "senses/vision=short_sighted", *SHORT, f"hydra.run.dir={tmp_path / 'run'}"]
    command = [sys.executable, "-c", program, *words]
    done = subprocess.run(
        command, env=installed, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.splitlines()[0]) < 0.6
    assert len((tmp_path / "run" / "metrics.csv").read_text().splitlines()) == 3


def test_a_preset_that_changed_is_read_again(outside):
    write_package(outside, "dim_plugin", "")
    preset = outside / "dim_plugin" / "conf" / "senses" / "vision" / "dim.yaml"
    preset.parent.mkdir(parents=True)
    (preset.parent / ".#dim.yaml").symlink_to("nobody@nowhere")  # the lock of an editor
    words = ["plugins=[dim_plugin]", "+task=KickTheBall", "senses/vision=dim"]
    found = []
    for blur_deg in (1.0, 12.5):
        preset.write_text(f"blur_deg: {blur_deg}\n")
        found.append(compose(words).senses.vision.blur_deg)
    assert found == [1.0, 12.5]


def test_a_task_that_is_defined_in_a_function_is_composed_twice(outside):
    @dataclass
    class LocalTaskCfg(TaskCfg):
        name: str = "LocalTask"
        reach_m: float = 1.0

    @register_task
    class LocalTask(Task):
        cfg: LocalTaskCfg
        senses = ("proprioception",)

        def build(self): ...

        def reset(self, rng): ...

        def reward(self, player):
            return {}

    for reach_m in (2.0, 2.0, 3.0):
        assert compose(["+task=LocalTask", f"task.reach_m={reach_m}"]).task.reach_m == reach_m


def test_a_plugin_that_is_installed_later_is_found(outside):
    compose(["+task=KickTheBall"])
    write_package(outside, "late_plugin", task_text("LateTask"))
    installed = outside / "late_plugin-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: late_plugin\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text("[veca_marl.plugins]\nlate = late_plugin\n")
    importlib.invalidate_caches()
    assert compose(["+task=LateTask"]).task.name == "LateTask"


def test_a_worker_process_loads_the_plugins_that_a_game_needs(outside):
    """A spawned collector receives the pickled factory and has not loaded the plug-in before.

    The configuration of this task is a plain `TaskCfg`, so that unpickling it imports no plug-in.
    """
    write_package(outside, "plain_plugin", task_text("PlainTask"))
    cfg = compose(["plugins=[plain_plugin]", "+task=PlainTask"])
    pickled = pickle.dumps(GameFactory(cfg.game, tuple(cfg.plugins)))
    del TASKS["PlainTask"], PLUGINS["plain_plugin"], sys.modules["plain_plugin"]
    factory = pickle.loads(pickled)
    assert "plain_plugin" not in sys.modules
    env = factory(1, 0)
    assert env.rollout(2).shape == (1, 2)
    env.close()


@pytest.fixture(scope="module")
def stored_run(tmp_path_factory):
    """A run of a plug-in that writes a file when it is imported."""
    folder = tmp_path_factory.mktemp("strangers") / "run"
    write_package(folder.parent, "payload", "from pathlib import Path\nPath('executed').touch()\n")
    words = ["plugins=[payload]", "+task=KickTheBall", "senses/vision=blind"]
    words += [f"hydra.run.dir={folder}", *SHORT]
    done = run_module("veca_marl.train", words, folder.parent)
    assert done.returncode == 0, done.stderr
    (folder.parent / "executed").unlink()
    return folder


def run_module(module, words, folder):
    command = [sys.executable, "-m", module, *words]
    path = os.pathsep.join([str(ROOT), str(folder)])
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["veca_marl.evaluate", "run={run}", "episodes=1"],
        ["veca_marl.train", "resume={run}"],
        ["veca_marl.play", "policy={run}"],
        ["veca_marl.tournament", "run={run}"],
    ],
    ids=["evaluate", "resume", "play", "tournament"],
)
def test_plugins_that_a_stored_run_names_are_not_imported(stored_run, words):
    module, *asked = (word.format(run=stored_run) for word in words)
    done = run_module(module, asked, stored_run.parent)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "payload" in line
    assert not (stored_run.parent / "executed").exists()


@pytest.mark.slow
def test_plugins_of_a_stored_run_are_imported_on_request(stored_run):
    words = ["plugins=[payload]", f"run={stored_run}", "episodes=1"]
    done = run_module("veca_marl.evaluate", words, stored_run.parent)
    assert done.returncode == 0, done.stderr
    (stored_run.parent / "executed").unlink()


@pytest.mark.slow
def test_a_run_with_a_plugin_is_resumed_if_the_plugin_is_named(stored_run):
    words = ["plugins=[payload]", f"resume={stored_run}", "total_frames=256"]
    done = run_module("veca_marl.train", words, stored_run.parent)
    assert done.returncode == 0, done.stderr
    (stored_run.parent / "executed").unlink()


@pytest.mark.slow
@pytest.mark.parametrize("entry", ["payload", "{a: 1}", "[1]"])
def test_an_entry_that_is_no_list_of_plugins_is_one_line(stored_run, tmp_path, entry):
    damaged = tmp_path / "damaged"
    shutil.copytree(stored_run, damaged)
    config = damaged / "config.yaml"
    config.write_text(config.read_text().replace("- payload", "").replace("plugins: [payload]", ""))
    config.write_text(f"{config.read_text()}\nplugins: {entry}\n")
    with pytest.raises(ConfigError):
        open_run(damaged).typed_config()
