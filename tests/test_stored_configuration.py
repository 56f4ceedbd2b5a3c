"""The configuration stored with a run is read with its types, without today's defaults."""

import pytest
from omegaconf import OmegaConf
from refusals import naming

from veca_marl.config import ConfigError, compose_node, conf_dir, to_config
from veca_marl.config.stored import body_names, change, typed
from veca_marl.envs.core.task import TASKS
from veca_marl.sim.hearing import AudioQuality
from veca_marl.stored_files import read_yaml

BODIES = sorted(path.stem for path in (conf_dir() / "body").glob("*.yaml"))
EXPERIMENTS = sorted(path.stem for path in (conf_dir() / "experiment").glob("*.yaml"))
CHOICES = [
    *([f"+task={name}"] for name in sorted(TASKS)),
    *(["+task=ObjectNav", f"body={name}"] for name in BODIES),
    *([f"+experiment={name}"] for name in EXPERIMENTS),
]
SEVERAL = ["+task=PushOut1v1", "+body@team.red.body=mitten", "+algo@learner.blue=mappo"]
SOME = [SEVERAL, ["+task=GrabObject"], ["+experiment=audio_ablation"]]


def read_again(node, path):
    path.write_text(OmegaConf.to_yaml(node, resolve=True))
    return typed(read_yaml(path), body_names(node))


@pytest.mark.parametrize(
    "overrides",
    [*SOME, *(pytest.param(choice, marks=pytest.mark.slow) for choice in CHOICES)],
    ids=" ".join,
)
def test_it_is_read_as_it_was_stored(overrides, tmp_path):
    node = compose_node(overrides)
    assert to_config(read_again(node, tmp_path / "config.yaml")) == to_config(node)


def test_a_run_of_version_0_2_is_read(tmp_path):
    """It has no intrinsic rewards, and another name for the runs that teams start from."""
    node = compose_node(["+task=PushOut1v1", "init_from.red=runs/there"])
    plain = OmegaConf.to_container(node, resolve=True, enum_to_str=True)
    plain["warm_start"] = plain.pop("init_from")
    for key in ("intrinsic", "team_intrinsic", "init_encoders"):
        del plain[key]
    read = typed(plain, body_names(node))
    assert to_config(read) == to_config(node)


def test_a_run_without_kernels_has_those_it_was_trained_with(tmp_path):
    node = compose_node(["+task=KickTheBall"])
    plain = OmegaConf.to_container(node, resolve=True, enum_to_str=True)
    del plain["algo"]["network"]["kernels"], plain["algo"]["network"]["strides"]
    network = to_config(typed(plain, body_names(node))).algo.network
    assert (network.kernels, network.strides) == ([8, 4, 3], [4, 2, 1])


@pytest.fixture
def stored(tmp_path):
    node = compose_node(
        ["+task=SoccerTwoPlayer", "senses.audio.noise_floor_db=20", "algo.clip=0.1"]
    )
    return read_again(node, tmp_path / "config.yaml")


def test_a_preset_replaces_its_group_and_nothing_else(stored):
    change(stored, ["senses/audio=mono"])
    cfg = to_config(stored)
    assert cfg.senses.audio.quality == AudioQuality.mono
    assert cfg.senses.audio.noise_floor_db is None
    assert cfg.algo.clip == 0.1


def test_values_of_teams_and_opponents_are_changed(stored):
    change(stored, ["opponent.defender=expert", "+senses/vision@team.attacker.senses.vision=blind"])
    cfg = to_config(stored)
    assert cfg.opponent == {"defender": "expert"}
    assert not cfg.game.senses_of("attacker").vision.present
    change(stored, ["~opponent.defender"])
    assert to_config(stored).opponent == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("algo.clip=1", ("algo.clip=1", "body", "clock")),
        ("+task=KickTheBall", ("+task=KickTheBall", "SoccerTwoPlayer")),
        ("senses/audio=momo", ("senses/audio", "'momo'", "mono")),
        ("task.max_second=1", ("'task.max_second'", "max_seconds")),
        ("task.max_seconds=x", ("task.max_seconds", "'x'")),
        ("~opponent.defender", ("~opponent.defender",)),
    ],
)
def test_a_wrong_change_is_one_line(stored, override, parts):
    with pytest.raises(ConfigError, match=naming(*parts)):
        change(stored, [override])


def test_an_unknown_key_that_is_added_is_refused(stored):
    change(stored, ["+team.attacker.speed=2"])
    with pytest.raises(ConfigError, match=naming("'team.attacker.speed'")):
        to_config(stored)
