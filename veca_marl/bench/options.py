"""Options of the benchmark."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class BenchCfg:
    """What is measured, and how often.

    Attributes:
        tasks: Tasks that are measured one after the other with their default bodies and senses, in
            one Markdown table; ``[all]`` for all tasks. Empty: the task of the command line.
        playgrounds: Playgrounds in which these tasks are measured; empty for that of each task.
        agents: Numbers of agents that move about in the playground of the task without its rules
            (free play), with its senses and bodies. Empty: the task itself is measured.
        worlds: Numbers of worlds in one environment; each is measured.
        loose_props: Balls and boxes on the floor, in free play.
        senses: Senses of the agents in free play; None takes those of the task.
        steps: Environment steps of each rollout.
        repeats: Rollouts of each kind; the tables contain medians.
        references: Whether single parts (eye, ears, skin) are measured as well.
        learning: Whether a run of the algorithm is measured beside rollouts, instead of the tables:
            the frames per second of learning as a share of cores x rollout.
        stages: Stages of that run; each takes `eval.every_frames`.
        json: File that the results are written to; None writes none.
    """

    tasks: list[str] = field(default_factory=list)
    playgrounds: list[str] = field(default_factory=list)
    agents: list[int] = field(default_factory=list)
    worlds: list[int] = field(default_factory=lambda: [1, 4])
    loose_props: int = 0
    senses: list[str] | None = None
    steps: int = 300
    repeats: int = 5
    references: bool = True
    learning: bool = False
    stages: int = 3
    json: str | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "repeats", "stages"):
            if getattr(self, name) < 1:
                raise ValueError(f"bench.{name} must be at least 1, got {getattr(self, name)}")
        for name in ("agents", "worlds"):
            if any(number < 1 for number in getattr(self, name)):
                raise ValueError(f"bench.{name} must be at least 1 each, got {getattr(self, name)}")
        if not self.worlds:
            raise ValueError("bench.worlds must contain a number of worlds")
        if self.playgrounds and not self.tasks:
            raise ValueError("bench.playgrounds needs bench.tasks; else use playground=NAME")
        if self.tasks and (self.agents or self.learning):
            raise ValueError("bench.tasks: measures neither free play nor learning")
        if self.loose_props < 0:
            raise ValueError(f"bench.loose_props must be 0 or more, got {self.loose_props}")
        if not self.agents and (self.loose_props or self.senses is not None):
            raise ValueError("bench.loose_props and bench.senses need bench.agents (free play)")
        if self.learning and self.agents:
            raise ValueError("bench.agents: free play is not learnt (bench.learning=true)")


@dataclass
class BenchOptions:
    """The options of the command, under its name."""

    bench: BenchCfg = field(default_factory=BenchCfg)
