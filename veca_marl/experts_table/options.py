"""Options of the table of experts."""

from __future__ import annotations

from dataclasses import dataclass, field

from veca_marl.envs.core.benchmark import EPISODES


@dataclass
class TableOptions:
    """What is played, and where the results are kept.

    Attributes:
        to: Folder of the results: a file of episodes for each task, and the table. Episodes that
            are in it are not played again.
        tasks: Names of the tasks; ``[all]`` for all.
        episodes: How many of the frozen episodes of each task are played by each policy, the first
            ones; 0 plays none and writes the table of the stored ones.
        processes: Processes that play at the same time.
        frozen: Whether the starts have to be the frozen ones. False plays the same seeds with
            another body, playground or parameter of the task, which gives other starts.
        replay: Stored episodes of each task and policy that are played once more and compared with
            what is stored; nothing else is played or written. 0 for none.
    """

    to: str = "runs/experts"
    tasks: list[str] = field(default_factory=lambda: ["all"])
    episodes: int = EPISODES
    processes: int = 1
    frozen: bool = True
    replay: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.episodes <= EPISODES:
            raise ValueError(f"episodes must be from 0 to {EPISODES}, got {self.episodes}")
        if self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")
        if self.replay < 0:
            raise ValueError(f"replay must be 0 or more, got {self.replay}")
        if not self.tasks:
            raise ValueError("tasks must name a task; [all] is all")
        twice = sorted({name for name in self.tasks if self.tasks.count(name) > 1})
        if twice:
            raise ValueError(f"tasks={self.tasks} names {twice[0]!r} more than once")
