"""`check_task` finds no fault of any task that is shipped."""

import pytest
from rollouts import game_cfg

from veca_marl.checks import CheckCfg, check_game

FEW = CheckCfg(starts=5, steps=25, seeding_steps=4, episodes=2)
# Two episodes are too few for an interval above 0; with more of them, which takes minutes,
# `test_the_expert_has_a_higher_return_than_the_random_policy` holds both for every task.
NEED_MANY_EPISODES = {"expert", "goal"}
MOST_S = 20.0
# tasks whose experts earn the last of their rewards later than that
LAST_LONGER = {"BabyzumasRevenge", "FillFraction", "MultiAgentNav", "ObjectPhysNav"}


@pytest.mark.slow  # four episodes of up to 20 s each, or of the length of the task
def test_check_task_finds_no_fault(task):
    own = game_cfg(task)
    if task not in LAST_LONGER:
        own.task.max_seconds = min(own.task.max_seconds, MOST_S)
    report = check_game(own, FEW)
    assert {finding.check for finding in report.failed} <= NEED_MANY_EPISODES, report
