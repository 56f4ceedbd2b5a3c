"""Checks of a task: seeding, specifications, starts, reward terms, expert and cost of a step."""

from veca_marl.checks.findings import Finding, Status, TaskReport
from veca_marl.checks.run import CheckCfg, check_game

__all__ = ["CheckCfg", "Finding", "Status", "TaskReport", "check_game"]
