"""The experiment of `small_experiment`, and the command that reports on it."""

import pytest
from small_experiment import EXPERIMENT

from veca_marl import report
from veca_marl.reports.arms import compose_arms


@pytest.fixture(scope="module")
def composed():
    return compose_arms(EXPERIMENT)


@pytest.fixture(scope="module")
def arms(composed):
    return {arm.name: arm.plain for arm in composed}


@pytest.fixture
def run(composed, capsys, monkeypatch):
    """The command, with the experiment composed once for all tests."""
    monkeypatch.setattr(report, "compose_arms", lambda overrides: composed)

    def call(*words):
        status = report.main([*EXPERIMENT, "expert_episodes=0", *words])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call
