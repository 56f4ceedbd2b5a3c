"""The laws of every task are tested with each task and each kind of action."""

import pytest
from rollouts import KINDS

from veca_marl.envs.core.task import TASKS


@pytest.fixture(scope="module", params=sorted(TASKS))
def task(request):
    return request.param


@pytest.fixture(scope="module", params=sorted(KINDS))
def kind(request):
    return request.param
