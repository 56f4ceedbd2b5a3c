"""Demonstrations on disk: what was recorded is read, and anything else is refused."""

import json
import pickle

import pytest
import torch
from demonstrated import archive_of, demonstrations_of_toy, forms, play, record_toy
from fake_env import FakeEnv
from refusals import naming
from tensordict import TensorDict

from veca_marl.algos.demonstration_files import CARD, INDEX, Array, DemonstrationsError, TeamForm
from veca_marl.algos.demonstrations import Demonstrations

FORMS = [{}, {"discrete": True}, {"hybrid": True}, {"agents": 2, "teams": ("red", "blue")}]


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_an_episode_is_read_as_it_was_played(tmp_path, form):
    played = record_toy(tmp_path, 3, **form)
    found = Demonstrations(tmp_path)
    assert (len(found), found.steps) == (3, sum(len(episode) for episode in played))
    for stored, rollout in zip(found.trajectories(), played, strict=True):
        leaves = dict(stored.items(True, True))
        for team in rollout["next"].keys():  # noqa: SIM118  a TensorDict
            if team in found.card.teams:
                assert (team, "action") in leaves or (team, "action", "move") in leaves
        for key, value in leaves.items():
            assert torch.equal(value, rollout[key]), key


def test_tensordict_itself_reads_the_data(tmp_path):
    played = record_toy(tmp_path, 2)
    rows = TensorDict.load_memmap(tmp_path / "data")
    assert len(rows) == sum(len(episode) + 1 for episode in played)
    steps = rows[~rows["end"]]
    assert torch.equal(steps["agents", "action"], torch.cat(played)["agents", "action"])


def test_changes_of_what_is_read_stay_in_the_process(tmp_path):
    found = demonstrations_of_toy(tmp_path)
    found.rows["agents", "action"][:] = 0.5
    assert not (Demonstrations(tmp_path).rows["agents", "action"] == 0.5).any()


def vision(folder):
    return folder / "data" / "agents" / "observation" / "vision.memmap"


def test_truncated_data_are_refused(tmp_path):
    record_toy(tmp_path)
    file = vision(tmp_path)
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(DemonstrationsError, match=r"vision\.memmap"):
        Demonstrations(tmp_path, verify=False)


def test_altered_data_are_refused(tmp_path):
    record_toy(tmp_path)
    content = bytearray(vision(tmp_path).read_bytes())
    content[len(content) // 2] ^= 1
    vision(tmp_path).write_bytes(content)
    Demonstrations(tmp_path, verify=False)
    with pytest.raises(DemonstrationsError, match="episode"):
        Demonstrations(tmp_path)


def test_an_altered_index_is_refused(tmp_path):
    record_toy(tmp_path)
    index = tmp_path / INDEX
    index.write_text(index.read_text().replace('"steps": 8', '"steps": 7'))
    with pytest.raises(DemonstrationsError):
        Demonstrations(tmp_path)


def test_a_missing_file_and_a_missing_folder_are_refused(tmp_path):
    with pytest.raises(DemonstrationsError, match=CARD):
        Demonstrations(tmp_path / "none")
    record_toy(tmp_path)
    vision(tmp_path).unlink()
    with pytest.raises(DemonstrationsError, match="vision"):
        Demonstrations(tmp_path)


def test_a_recording_that_is_not_complete_is_refused(tmp_path):
    archive = archive_of(tmp_path, 4)
    play(archive, 0)
    with pytest.raises(DemonstrationsError, match=naming("1", "4")):
        Demonstrations(tmp_path)


DAMAGE = {
    "format": 2,
    "kind": "other",
    "seed": -1,
    "episodes": 1e400,
    "teams": [],
    "arrays": [{"key": ["..", "..", "secret"], "shape": [1], "dtype": "uint8", "role": "state"}],
    "checksum": 3,
    "control_rate_hz": None,
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_card_with_other_content_is_refused_in_one_line(tmp_path, name):
    record_toy(tmp_path)
    card = json.loads((tmp_path / CARD).read_text())
    card[name] = DAMAGE[name]
    (tmp_path / CARD).write_text(json.dumps(card))
    with pytest.raises(DemonstrationsError) as caught:
        Demonstrations(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [CARD, INDEX])
def test_nothing_is_unpickled(tmp_path, name):
    record_toy(tmp_path)
    (tmp_path / name).write_bytes(pickle.dumps({"kind": "veca_marl demonstrations"}))
    with pytest.raises(DemonstrationsError):
        Demonstrations(tmp_path)


@pytest.mark.parametrize("key", [[], [".."], ["a/b"], ["agents", ""], "agents", [3]])
def test_keys_of_arrays_are_names(key):
    plain = {"key": key, "shape": [1], "dtype": "uint8", "role": "state"}
    with pytest.raises(ValueError, match="key"):
        Array.from_dict(plain)


def test_another_form_of_the_action_another_body_and_other_senses_are_refused(tmp_path):
    found = demonstrations_of_toy(tmp_path)
    own = forms(FakeEnv())["agents"]
    found.check_team("agents", own)
    with pytest.raises(DemonstrationsError, match="discrete"):
        found.check_team("agents", forms(FakeEnv(discrete=True))["agents"])
    with pytest.raises(DemonstrationsError, match="kind"):
        found.check_team("agents", TeamForm(own.spec, {"kind": "Other"}, {}))
    with pytest.raises(DemonstrationsError, match="ears"):
        found.check_team("agents", TeamForm(own.spec, own.body, {"ears": {"quality": "mono"}}))
    with pytest.raises(DemonstrationsError, match="red"):
        found.check_team("red", own)
