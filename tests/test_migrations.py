"""Configurations of older versions are brought to the form of this one, and back for digests."""

import json
import math
from copy import deepcopy
from pathlib import Path

import pytest
import torch
import yaml
from omegaconf import OmegaConf
from refusals import naming

from veca_marl.algos.checkpoints import CheckpointError, Checkpoints, Identity, read_checkpoint
from veca_marl.config import ConfigError, compose_node, to_config
from veca_marl.config.stored import body_names, typed
from veca_marl.migrations import (
    CONFIG_VERSION,
    KEY,
    STEPS,
    Added,
    VersionError,
    first_form,
    migrated,
    migrated_checkpoint,
    numbered,
)
from veca_marl.runs.run_folder import RunFolder, open_run

DATA = Path(__file__).parent / "data_of_0_2_0"
OLD = yaml.safe_load((DATA / "push_out.yaml").read_text())
BODIES = json.loads((DATA / "push_out_bodies.json").read_text())


def test_a_configuration_that_version_0_2_0_wrote_is_read():
    """``+task=PushOut1v1 warm_start.red=...`` with own hearing of one team, own learner of one."""
    cfg = to_config(typed(OLD, BODIES))
    assert cfg.init_from == {"red": "runs/there"}
    assert cfg.intrinsic.name == "none"
    assert cfg.body.call_pause_s == 0.0
    assert cfg.clock.sleep_s == math.inf
    assert cfg.team["red"].senses.extra == {}
    for network in (cfg.algo.network, cfg.learner["blue"].network):
        assert (network.kernels, network.strides) == ([8, 4, 3], [4, 2, 1])


def test_what_is_stored_is_not_changed():
    before = deepcopy(OLD)
    assert migrated(OLD) != OLD
    assert before == OLD


def test_the_first_form_is_what_version_0_stored():
    first = first_form(migrated(OLD))
    assert {**first, "init_encoders": {}} == {**OLD, "init_encoders": {}}
    assert first_form(first) == first


def test_another_value_than_before_stays_in_the_first_form():
    cfg = {"clock": {"sleep_s": 0.4}, "playground": {"props": [{"partition": True}, {}]}}
    assert first_form(cfg) == cfg


@pytest.mark.parametrize("step", STEPS)
def test_fields_that_are_present_stay(step):
    for change in step.changes:
        if isinstance(change, Added):
            before = {"name": change.name, change.beside: 1, **dict.fromkeys(change.values, "own")}
            change.apply(node := dict(before))
            assert node == before


def test_fields_belong_to_one_registered_name():
    other = {"task": {"name": "ObjectNav"}, "algo": {"network": {"name": "ears"}}}
    assert {**migrated(other), **other} == migrated(other)
    assert "separate_finder" in migrated({"task": {"name": "MultiAgentNav"}})["task"]


def test_a_configuration_of_this_version_stays_as_it_is():
    assert migrated(numbered({"task": {"name": "MultiAgentNav"}})) == {
        "task": {"name": "MultiAgentNav"}
    }


@pytest.mark.parametrize("version", [CONFIG_VERSION + 1, -1, "1", None, True, 0.5])
def test_a_version_that_is_not_known_is_refused(version):
    with pytest.raises(VersionError, match=KEY):
        migrated({KEY: version})
    with pytest.raises(ConfigError, match=KEY):
        typed({**OLD, KEY: version}, BODIES)


def test_nodes_of_another_kind_than_expected_are_left_to_the_types():
    damaged = {"body": 3, "team": [1], "playground": {"props": {"a": 1}}, "algo": None}
    assert {**migrated(damaged), **damaged} == migrated(damaged)


def test_a_run_stores_the_version(tmp_path):
    node = compose_node(["+task=KickTheBall"])
    folder = tmp_path / "run"
    folder.mkdir()
    run = RunFolder(folder)
    run.begin(node, [])
    stored = yaml.safe_load(run.config.read_text())
    assert stored.pop(KEY) == CONFIG_VERSION
    assert stored == yaml.safe_load(OmegaConf.to_yaml(node, resolve=True))
    assert to_config(open_run(folder).typed_config()) == to_config(node)
    assert body_names(open_run(folder).typed_config()) == body_names(node)


def test_a_checkpoint_of_version_0_gets_the_values_of_that_time():
    network = {"name": "multisense", "channels": [16, 32, 32]}
    weights = torch.zeros(3)
    content = {
        "config": {"algo": {"network": network}, "warm_start": {}},
        "algorithms": {"red": {"name": "ppo", "network": network}},
        "state": {"weights": weights},
    }
    read = migrated_checkpoint(content)
    assert read["algorithms"]["red"]["network"]["kernels"] == [8, 4, 3]
    assert read["config"]["algo"]["network"]["kernels"] == [8, 4, 3]
    assert read["config"]["init_from"] == {}
    assert read["state"]["weights"] is weights
    assert read["state"]["intrinsic"] == {}
    assert "kernels" not in network


def test_a_checkpoint_of_a_newer_version_is_refused(tmp_path):
    path = Checkpoints(tmp_path, Identity("Toy", {}), {}).save({"n": 1}, 10, best=False)
    content = torch.load(path, weights_only=True)
    assert content[KEY] == CONFIG_VERSION
    assert read_checkpoint(path, torch.device("cpu"))["state"] == {"n": 1}
    torch.save({**content, KEY: CONFIG_VERSION + 1}, path)
    with pytest.raises(CheckpointError, match=naming(path.name, f"{KEY}={CONFIG_VERSION + 1}")):
        read_checkpoint(path, torch.device("cpu"))


def test_the_height_of_a_capsule_made_way_for_that_of_the_body():
    old = {"body": {"push_limit_kg": 5.0, "height_m": 0.6}, "team": {}}
    body = migrated(old)["body"]
    assert body["capsule_height_m"] == 0.6
    assert body["height_m"] is None
    assert migrated({"body": {"strength": 1.0}, "team": {}})["body"]["height_m"] is None


def test_bodies_of_two_heights_have_two_first_forms():
    def walker(**size):
        return {"body": {"push_limit_kg": 5.0, "capsule_height_m": 0.72, **size}, "team": {}}

    forms = [first_form(walker(age_months=None, height_m=height)) for height in (None, 0.6, 0.7)]
    assert forms[0]["body"]["height_m"] == 0.72
    assert forms[1] != forms[2]
    assert forms[1] != forms[0]
