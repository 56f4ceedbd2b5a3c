"""The laws of every task are tested with each task and each kind of action."""

import pytest
from rollouts import KINDS

from veca_marl.envs.core.task import TASKS

# tasks that the quick suite plays also with a body that is not their own: walkers, joints, two
# teams, voices; the slow suite does with all
WITH_OTHER_BODY = ("KickTheBall", "TurnBaby", "PushOut1v1", "MultiAgentNav")


def pytest_generate_tests(metafunc):
    """Give a test each task, and each kind of action if it depends on `kind`."""
    if "kind" in metafunc.fixturenames:
        pairs = [_pair(task, kind) for task in sorted(TASKS) for kind in KINDS]
        metafunc.parametrize(("task", "kind"), pairs, scope="module")
    elif "task" in metafunc.fixturenames:
        metafunc.parametrize("task", sorted(TASKS), scope="module")


def _pair(task, kind):
    quick = kind == "own" or task in WITH_OTHER_BODY
    return pytest.param(task, kind, marks=() if quick else pytest.mark.slow)
