"""What an experiment may declare."""

import pytest

from veca_marl.config.experiment import ExperimentCfg

ARMS = {"a": ["seed=1"], "b": []}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"arms": ARMS}, "experiment.name: an experiment with arms, seeds or claims needs one"),
        ({"name": "a b"}, "experiment: 'a b' cannot be the name"),
        ({"name": "x", "arms": {"random": []}}, "'random' cannot be the name of an .* or arm"),
        ({"name": "x", "arms": ARMS, "arm": "c"}, "experiment.arm=c: no such arm; choices: a, b"),
        ({"name": "x", "seeds": [1, 1]}, r"seeds must differ and be 0 or more, got \[1, 1\]"),
        ({"name": "x", "seeds": [-1]}, r"seeds must differ and be 0 or more, got \[-1\]"),
        ({"name": "x", "arms": ARMS, "claims": ["a > c"]}, "claim 'a > c': no arm 'c'"),
        (
            {"name": "x", "arms": ARMS, "claims": ["a faster than b"]},
            "claim 'a faster than b': experiment.threshold must say",
        ),
    ],
)
def test_impossible_declarations_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        ExperimentCfg(**fields)


def test_a_run_without_experiment_needs_nothing():
    assert ExperimentCfg().name is None
