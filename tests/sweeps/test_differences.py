"""How the configuration of a stored run is compared with the one that is asked for."""

import pytest
from refusals import naming
from stored_runs import write_run

from veca_marl.config import root
from veca_marl.migrations import CONFIG_VERSION, numbered
from veca_marl.sweeps.differences import BY_TEAM, differences, key_patterns
from veca_marl.sweeps.run_state import read_run

BALL = {"name": "ball", "mass_kg": 0.3, "size_m": [0.1]}
BOX = {"name": "box", "mass_kg": 1.0, "size_m": [0.1, 0.2, 0.3]}


def props(*cfgs):
    return {"playground": {"props": list(cfgs)}}


def test_equal_configurations_do_not_differ():
    assert differences(props(BALL, BOX), props(BALL, BOX)) == []


def test_a_key_that_another_version_lacks_is_told_from_a_changed_value_in_lists_too():
    (added,) = differences(props(BALL, BOX), props(BALL, {**BOX, "joint": None}))
    assert (added.key, added.of_version) == ("playground.props.1.joint", True)
    (changed,) = differences(props(BALL, BOX), props(BALL, {**BOX, "mass_kg": 2.0}))
    assert not changed.of_version
    assert str(changed) == "playground.props.1.mass_kg is 1.0 in the run, 2.0 is asked for"


def network(**fields):
    return {"algo": {"network": {"name": "multisense", **fields}}}


@pytest.mark.parametrize(("version", "differs"), [({}, True), (numbered({}), False)])
def test_a_stored_run_is_compared_in_the_form_of_this_version(tmp_path, version, differs):
    """An entry that only later versions have is that of the early run; else it is not compared."""
    write_run(tmp_path / "run", {**network(), **version}, [(100, 1.0)])
    stored = read_run(tmp_path / "run").config
    found = differences(stored, {**stored, **network(kernels=[4, 4, 3], strides=[4, 2, 1])})
    changed = [str(d) for d in found if not d.of_version]
    text = "algo.network.kernels is [8, 4, 3] in the run, [4, 4, 3] is asked for"
    assert changed == [text] * differs


def test_a_run_of_a_newer_version_is_refused(tmp_path):
    write_run(tmp_path / "run", {**network(), "config_version": CONFIG_VERSION + 1}, [(100, 1.0)])
    with pytest.raises(
        ValueError, match=naming("config.yaml", f"config_version={CONFIG_VERSION + 1}")
    ):
        read_run(tmp_path / "run")


def test_lists_of_other_lengths_differ():
    for stored, asked in ((props(), props(BALL)), (props(BALL, BOX), props(BALL))):
        assert any(not d.of_version for d in differences(stored, asked))
    lists = {"channels": []}, {"channels": [16]}
    assert any(not d.of_version for d in differences(*lists))


def test_elements_of_a_list_are_named_by_one_pattern():
    keys = [
        "playground.props.0.joint",
        "playground.props.12.joint",
        "playground.props.1.parts.number",
        "seed",
    ]
    assert key_patterns(keys) == ["playground.props.*.joint", "playground.props.*.parts", "seed"]


@pytest.mark.parametrize(
    ("stored", "asked"),
    [
        ({"opponent": {}}, {"opponent": {"blue": "expert"}}),
        ({"opponent": {"red": "random"}}, {"opponent": {"red": "random", "blue": "expert"}}),
        ({"team": {"red": {"senses": 1}}}, {"team": {"blue": {"senses": 1}}}),
        (
            {"algo": {"entropy_coefficient": 0.03}},
            {"algo": {"entropy_coefficient": {"move": 0.003}}},
        ),
        (
            {"algo": {"entropy_coefficient": {"move": 0.003}}},
            {"algo": {"entropy_coefficient": {"move": 0.003, "voice": 0.01}}},
        ),
        (
            {"learner": {"red": {"entropy_coefficient": {"move": 0.003}}}},
            {"learner": {"red": {"entropy_coefficient": {"voice": 0.01}}}},
        ),
    ],
)
def test_other_names_and_a_mapping_in_place_of_a_value_are_changed_values(stored, asked):
    for one, other in ((stored, asked), (asked, stored)):
        found = differences(one, other)
        assert found
        assert not any(d.of_version for d in found)


def test_keys_of_one_version_below_a_name_of_the_user_are_told_apart():
    stored, asked = {"team": {"red": {"body": 1}}}, {"team": {"red": {"body": 1, "new": 2}}}
    (added,) = differences(stored, asked)
    assert (added.key, added.of_version) == ("team.red.new", True)
    (added,) = differences({}, {"team": {"red": {"body": 1}}})
    assert added.of_version


def test_all_mappings_from_the_names_of_teams_are_known():
    assert BY_TEAM == root.BY_TEAM
