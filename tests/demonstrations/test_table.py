"""The table of expert, imitation and random policy: what is stored is not made again, nor mixed."""

import json

import pytest
from refusals import naming

from veca_marl.config import ConfigError
from veca_marl.demonstrations.table import TableOptions, make_table

WORDS = ["senses/vision=blind", "total_frames=1", "threads=1"]
STORED = {"agents": {"return": 1.0, "interval": [0.5, 1.5], "episodes": 2}}


@pytest.fixture
def stored(tmp_path):
    """A folder with the recording and the scores of one task, without a learnt policy."""
    options = TableOptions(["KickTheBall"], str(tmp_path), [], episodes=1, frozen=2, processes=0)
    (tmp_path / "KickTheBall").mkdir()
    for player in ("expert", "random"):
        path = tmp_path / "KickTheBall" / f"scores_{player}_2.json"
        path.write_text(json.dumps(STORED))
    return options


def test_what_is_stored_is_not_played_again(stored):
    text = make_table(stored, WORDS)
    assert text.count("1.00 [0.50, 1.50]") == 2
    assert make_table(stored, WORDS) == text


def test_a_table_of_stored_scores_needs_neither_recording_nor_run(stored, tmp_path):
    scores = tmp_path / "KickTheBall" / "scores_bc_2.json"
    scores.write_text(json.dumps(STORED))
    options = TableOptions(**{**vars(stored), "algos": ["bc"]})
    assert make_table(options, WORDS).count("1.00 [0.50, 1.50]") == 3
    assert not (tmp_path / "KickTheBall" / "demonstrations").exists()


@pytest.mark.parametrize(
    ("changed", "words", "named"),
    [
        ({"episodes": 2}, WORDS, ("episodes=1", "2")),
        ({"seed": 5}, WORDS, ("seed=0", "5")),
        ({}, [*WORDS, "total_frames=2"], ("overrides", "total_frames=2")),
    ],
    ids=str,
)
def test_results_of_other_choices_are_not_mixed(stored, changed, words, named):
    make_table(stored, WORDS)
    other = TableOptions(**{**vars(stored), **changed})
    with pytest.raises(ConfigError, match=naming("KickTheBall", *named)):
        make_table(other, words)
