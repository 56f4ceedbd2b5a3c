import math
from functools import cache
from itertools import chain, zip_longest

import hydra
import pytest
import yaml
from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf
from refusals import naming

from veca_marl.algos.training.schedule import Schedule
from veca_marl.config import Config, ConfigError, compose, compose_node, conf_dir
from veca_marl.config.compose import _job_folder
from veca_marl.datasets.dataset import DATASETS
from veca_marl.envs.core.task import TASKS
from veca_marl.sim.body.humanoid import Detail, HumanoidCfg
from veca_marl.sim.body.humanoid import JointActionKind as Act
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.hearing import AudioQuality
from veca_marl.sim.senses import SensesCfg

KICK = "+task=KickTheBall"
PUSH = "+task=PushOut1v1"
SENSES = ("audio", "proprioception", "touch", "vision")
GROUPS = [
    "algo",
    "body",
    "clock",
    "collect",
    "intrinsic",
    "log",
    "playground",
    *(f"senses/{name}" for name in SENSES),
]
PRESETS = [(g, path.stem) for g in GROUPS for path in sorted((conf_dir() / g).glob("*.yaml"))]
# the first preset of each group together, the second ones, ...: fewer compositions than presets
TOGETHER = zip_longest(*([f"{g}={p}" for g, p in PRESETS if g == group] for group in GROUPS))
EXPERIMENTS = sorted(path.stem for path in (conf_dir() / "experiment").glob("*.yaml"))


@cache
def composed_task(name):
    return compose([f"+task={name}"])


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(TASKS))
def test_episodes_end_before_the_worlds_start_new_ones(task):
    """What comes later in an episode would not be learnt from."""
    cfg = composed_task(task)
    episode = math.ceil(cfg.game.max_steps / cfg.collect.steps)
    numbers = cfg.total_frames, cfg.eval.every_frames, cfg.collect.frames
    stage = Schedule.of(*numbers, episode)
    stages = [*stage.stages_after(0)][1 if stage.early_batches else 0 :]
    steps = [batches * cfg.collect.steps for batches in stages]
    assert min(steps) >= cfg.game.max_steps


@pytest.mark.parametrize("task", sorted(TASKS))
def test_every_task_composes_to_its_own_type(task):
    cfg = composed_task(task)
    assert type(cfg.task) is TASKS[task].cfg_type()
    assert cfg.task.name == task


def test_every_task_has_a_file_and_every_file_a_task():
    assert {path.stem for path in (conf_dir() / "task").glob("*.yaml")} == set(TASKS)


@pytest.mark.parametrize("choices", [list(filter(None, row)) for row in TOGETHER], ids=" ".join)
def test_every_preset_composes(choices):
    assert isinstance(compose(["+task=ObjectNav", *choices]), Config)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes(name):
    assert isinstance(compose([f"+experiment={name}"]), Config)


def test_experiments_accept_another_seed_and_sense():
    cfg = compose(["+experiment=audio_ablation", "senses/audio=mono", "seed=4"])
    assert (cfg.senses.audio.quality, cfg.seed) == (AudioQuality.mono, 4)


def test_every_file_is_tested():
    files = {path.relative_to(conf_dir()).as_posix() for path in conf_dir().rglob("*.yaml")}
    tested = {f"{g}/{p}.yaml" for g, p in PRESETS} | {f"experiment/{n}.yaml" for n in EXPERIMENTS}
    tested |= {f"dataset/{name}.yaml" for name in DATASETS}
    assert files - tested - {f"task/{name}.yaml" for name in TASKS} == {
        "config.yaml",
        "datasets.yaml",
    }


@pytest.mark.parametrize("path", sorted(conf_dir().rglob("*.yaml")), ids=lambda p: p.stem)
def test_no_preset_has_a_name_that_yaml_reads_as_a_boolean(path):
    assert isinstance(yaml.safe_load(path.stem), str)


def test_files_hold_only_what_differs_from_the_dataclasses():
    for sense in SENSES:
        for path in (conf_dir() / "senses" / sense).glob("*.yaml"):
            everything = path.read_text().startswith("# @package _global_")
            default = OmegaConf.structured(Config if everything else SensesCfg().of(sense))
            for key, value in (OmegaConf.load(path) or {}).items():
                merged = OmegaConf.merge({"x": default}, {"x": {key: value}})
                assert merged.x[key] != default[key], f"{path} restates {key}"


@pytest.mark.parametrize(
    ("overrides", "parts"),
    [
        ([], ("+task=NAME", "KickTheBall")),
        (["task=KickTheBall"], ("+task=KickTheBall",)),
        (["+task=KickTheBal"], ("'KickTheBal'", "KickTheBall", "MazeNav")),
        ([KICK, "seed=abc"], ("seed", "'abc'")),
        ([KICK, "task.life_s=x"], ("task.life_s", "'x'")),
        ([KICK, "sede=1"], ("'sede'", "seed", "playground")),
        ([KICK, "senses/visoin=blind"], ("'senses/visoin'", "vision", "audio")),
        ([KICK, "sensors/vision=blind"], ("'sensors/vision'", "playground")),
        ([KICK, "+sede=1"], ("'sede'", "playground")),
        ([KICK, "+algo.clipp=1"], ("'algo.clipp'", "clip,", "gamma")),
        ([KICK, "task.kick_reech=1"], ("'task.kick_reech'", "life_s", "loudness")),
        ([KICK, "task.weights.kik=1"], ("'task.weights.kik'", "approach", "kick")),
        ([KICK, "senses/audio=off"], ("senses/audio", "'off'", "deaf", "mono")),
        ([KICK, "playground=hose"], ("playground", "'hose'", "single_room")),
        ([KICK, "senses.audio.quality=loud"], ("quality", "'loud'", "hrtf", "stereo")),
        ([KICK, "algo.clip=-1"], ("algo.clip", "-1.0")),
        ([KICK, "task.name=Nim"], ("'Nim'", "KickTheBall")),
        ([KICK, "total_frames=0"], ("total_frames", " 0")),
        ([KICK, "algo.minibatches=9999"], ("algo.minibatches=9999",)),
        ([KICK, "see d=1"], ("see d=1",)),
        ([KICK, "task.speed_mps=[1]"], ("task.speed_mps=[1.0]", "2")),
        ([KICK, "task.speed_mps=fast"], ("task.speed_mps", "list")),
        ([KICK, "senses.audio=mono"], ("senses.audio", "senses/audio=NAME")),
        ([KICK, "senses.audio=null"], ("senses.audio", "null", "senses/audio=")),
        ([KICK, "+senses.extra.compas.noisy=true"], ("'compas'", "audio", "vision")),
        ([KICK, "+senses.extra.audio.quality=mono"], ("senses.extra.audio", "senses.audio")),
        ([PUSH, "opponent.green=idle"], ("opponent", "green", "red", "blue")),
        ([PUSH, "opponent.red=nobody"], ("opponent.red=nobody", "expert", "random")),
        ([PUSH, "opponent.red=idle", "opponent.blue=idle"], ("opponent", "['red', 'blue']")),
        ([PUSH, "+algo@learner.green=mappo"], ("learner", "green", "red", "blue")),
        ([PUSH, "self_play.teams=[red]"], ("self_play.teams=['red']",)),
        ([PUSH, "self_play.teams=[red,blue,red]"], ("self_play.teams=['red', 'blue', 'red']",)),
        (
            [PUSH, "self_play.teams=[red,blue]", "opponent.blue=idle"],
            ("self_play.teams", "['blue']", "['red']"),
        ),
    ],
)
def test_errors_are_one_line_with_the_choices(overrides, parts):
    with pytest.raises(ConfigError, match=naming(*parts)):
        compose(overrides)


@pytest.mark.slow
def test_compose_does_not_depend_on_earlier_calls():
    assert compose([KICK, "seed=5"]).seed == 5
    assert compose([KICK]).seed == 0
    with pytest.raises(ConfigError):
        compose([KICK, "seed=x"])
    assert compose([KICK]) == compose([KICK])


def test_node_and_dataclasses_agree():
    assert (
        compose_node([KICK, "algo.clip=0.3"]).algo.clip
        == compose([KICK, "algo.clip=0.3"]).algo.clip
    )


def test_compose_works_inside_a_running_hydra_application(tmp_path, monkeypatch):
    seen = []

    @hydra.main(version_base="1.3", config_path=str(tmp_path))
    def application(cfg):
        inner = compose([KICK, "seed=3"])
        seen.extend([inner.seed, cfg.x, HydraConfig.get().job.name])

    quiet = ["hydra/job_logging=none", "hydra/hydra_logging=none", "hydra.output_subdir=null"]
    words = ["+x=7", "hydra.job.name=outer", f"hydra.run.dir={tmp_path}", *quiet]
    monkeypatch.setattr("sys.argv", ["application", *words])
    application()
    assert seen == [3, 7, "outer"]


def test_configuration_survives_the_file_of_a_run(tmp_path):
    node = compose_node([KICK, "senses/audio=stereo", "playground=simple", "seed=9"])
    (tmp_path / "config.yaml").write_text(OmegaConf.to_yaml(node, resolve=True))
    merged = OmegaConf.merge(compose_node([KICK]), OmegaConf.load(tmp_path / "config.yaml"))
    again = OmegaConf.to_object(merged)
    assert again == compose([KICK, "senses/audio=stereo", "playground=simple", "seed=9"])
    assert list(chain(again.playground.props)), "lists keep their types"


@pytest.mark.parametrize(
    ("preset", "kind", "different"),
    [
        ("walker", WalkerCfg, {}),
        ("full", HumanoidCfg, {}),
        ("mitten_position", HumanoidCfg, {"detail": Detail.mitten, "action": Act.position}),
    ],
)
def test_a_body_composes_to_its_own_type(preset, kind, different):
    assert compose(["+task=ObjectNav", f"body={preset}"]).body == kind(**different)


def test_a_body_takes_its_own_numbers_alone():
    assert compose(["+task=ObjectNav", "body=mitten", "body.strength=0.5"]).body.strength == 0.5
    with pytest.raises(ConfigError, match="walk_speed_mps"):
        compose(["+task=ObjectNav", "body=mitten", "body.walk_speed_mps=0.5"])
    with pytest.raises(ConfigError, match=r"body\.detail|Detail"):
        compose(["+task=ObjectNav", "body=full", "body.detail=stick"])


@pytest.mark.parametrize(
    ("words", "choice"),
    [
        (["+task=null"], "MazeNav"),
        ([KICK, "senses/vision=null"], "blind"),
        ([KICK, "playground=[1]"], "single_room"),
        ([KICK, "body=3"], "mitten"),
    ],
)
def test_a_group_without_the_name_of_a_preset_is_refused(words, choice):
    with pytest.raises(ConfigError, match=naming(words[-1], choice)):
        compose(words)


@pytest.mark.parametrize("other", ["DodgeCar", "MazeNav", "SoccerTwoPlayer"])
def test_another_task_is_not_chosen_by_its_name(other):
    parts = (f"task.name={other}", "KickTheBallCfg", f"+task={other}")
    with pytest.raises(ConfigError, match=naming(*parts)):
        compose([KICK, f"task.name={other}"])


def test_long_names_of_runs_are_shortened_and_stay_apart():
    """File systems take 255 bytes."""
    long = ",".join(f"algo.part_{number}=0.{number}" for number in range(40))
    folders = [_job_folder(None, text, 3) for text in (long, long, f"{long}1", "a=\u00e9" * 90)]
    for folder in folders:
        name, seed = folder.split("/")
        assert len(name.encode()) <= 200
        assert seed == "seed_3"
    assert folders[0] == folders[1]
    assert len(set(folders)) == 3
    assert _job_folder(None, "+task=A,algo/x=1", 0) == "task=A,algo.x=1/seed_0"


@pytest.mark.parametrize("part", ["={a:1}", "={thickness_m:0.1}", ".thickness_m=0.1"])
def test_a_part_of_walls_that_a_playground_lacks_is_refused(part):
    with pytest.raises(ConfigError, match=naming(f"playground.walls{part}", "null")):
        compose(["+task=KickTheBall", f"playground.walls{part}"])
    walled = compose(["+task=KickTheBall", "playground=house", "playground.walls.thickness_m=0.1"])
    assert walled.playground.walls.thickness_m == 0.1


def test_what_is_composed_again_has_no_trace_of_what_was_changed():
    first = compose_node([KICK])
    first.total_frames, first.task.max_seconds = 5, 1.5
    compose([KICK]).task.max_seconds = 2.5
    assert compose_node([KICK]).total_frames == compose([KICK]).total_frames != 5
    assert compose_node([KICK]).task.max_seconds == compose([KICK]).task.max_seconds
    assert compose([KICK]).task.max_seconds not in (1.5, 2.5)


@pytest.mark.parametrize("key", ["init_from", "opponent"])
def test_a_value_without_its_team_is_refused_with_the_words_that_name_one(key):
    with pytest.raises(ConfigError, match=naming(f"{key}.TEAM=", f"{key}.agents")):
        compose([KICK, f"{key}=zoo/KickTheBall"])
