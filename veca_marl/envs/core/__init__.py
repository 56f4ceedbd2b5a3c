"""The core of a game: tasks, teams, reward terms, actions, episodes, and the game itself."""

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.expert import Expert, find_expert, has_expert, register_expert
from veca_marl.envs.core.game import Game, Observation, Outcome, from_parts, random_action, to_parts
from veca_marl.envs.core.game_cfg import GameCfg, Script, TeamCfg
from veca_marl.envs.core.task import (
    SOLVED,
    Player,
    Task,
    TaskCfg,
    Team,
    find_task,
    register_task,
    terms,
)

__all__ = [
    "SOLVED",
    "Episodes",
    "Expert",
    "Game",
    "GameCfg",
    "Observation",
    "Outcome",
    "Player",
    "Script",
    "Task",
    "TaskCfg",
    "Team",
    "TeamCfg",
    "find_expert",
    "find_task",
    "from_parts",
    "has_expert",
    "random_action",
    "register_expert",
    "register_task",
    "terms",
    "to_parts",
]
