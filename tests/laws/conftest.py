"""The laws of every task are tested with each task and each kind of action."""

import pytest
from rollouts import KINDS

from veca_marl.envs.core.task import TASKS

# tasks that the quick suite plays also with a body that is not their own: walkers, joints, two
# teams, voices; the slow suite does with all
WITH_OTHER_BODY = ("KickTheBall", "TurnBaby", "PushOut1v1", "MultiAgentNav")
# games of several joint-level bodies with eyes and skin, which the quick suite plays with walkers
WITH_WALKERS = ("PushOut2v2", "SoccerTwoPlayer")


def pytest_generate_tests(metafunc):
    """Give a test each task, and each kind of action if it depends on `kind`."""
    if "kind" in metafunc.fixturenames:
        pairs = [_pair(task, kind) for task in sorted(TASKS) for kind in KINDS]
        metafunc.parametrize(("task", "kind"), pairs, scope="module")
    elif "task" in metafunc.fixturenames:
        metafunc.parametrize("task", sorted(TASKS), scope="module")


def _pair(task, kind):
    quick = task in WITH_OTHER_BODY or (kind == "own") != (task in WITH_WALKERS)
    return pytest.param(task, kind, marks=() if quick else pytest.mark.slow)
