"""What an experiment may declare."""

import pytest
from refusals import naming

from veca_marl.config.experiment import ExperimentCfg

ARMS = {"a": ["seed=1"], "b": []}


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        ({"arms": ARMS}, ("experiment.name", "arms")),
        ({"name": "a b"}, ("experiment", "'a b'")),
        ({"name": "x", "arms": {"random": []}}, ("experiment", "'random'")),
        ({"name": "x", "arms": ARMS, "arm": "c"}, ("experiment.arm=c", "a, b")),
        ({"name": "x", "seeds": [1, 1]}, ("seeds", "[1, 1]")),
        ({"name": "x", "seeds": [-1]}, ("seeds", "[-1]")),
        ({"name": "x", "arms": ARMS, "claims": ["a > c"]}, ("'a > c'", "'c'")),
        (
            {"name": "x", "arms": ARMS, "claims": ["a faster than b"]},
            ("'a faster than b'", "experiment.threshold"),
        ),
    ],
)
def test_impossible_declarations_are_refused(fields, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        ExperimentCfg(**fields)


def test_a_run_without_experiment_needs_nothing():
    assert ExperimentCfg().name is None
