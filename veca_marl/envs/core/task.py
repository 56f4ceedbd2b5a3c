"""What a task is: who plays, what lies on the floor, how it starts, what pays, when it ends."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, get_type_hints

import numpy as np

from veca_marl.registry import Registry
from veca_marl.sim.body.base import Body
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.walker.walker import Walker
from veca_marl.sim.physics.world import World


class Team(NamedTuple):
    """Players that share specs and a policy: one team is one TorchRL group.

    Attributes:
        name: Unique in its task.
        size: How many play.
        senses: What they perceive by; None is what the task names for everyone.
        shirt: Number of their shirts' colour (blue, red, green, yellow); None is the team's own
            number, from 0 on.
    """

    name: str
    size: int = 1
    senses: tuple[str, ...] | None = None
    shirt: int | None = None


class Player(NamedTuple):
    """One body on one team."""

    name: str
    team: str
    body: Body


def walker(player: Player) -> Walker:
    """Return a player's body where a task needs one that walks and kicks.

    Raises:
        ValueError: If it is moved by its joints.
    """
    if not isinstance(player.body, Walker):
        raise ValueError(
            f"{player.name}: this task needs a body that walks and kicks; choose body=walker"
        )
    return player.body


def humanoid(player: Player) -> Humanoid:
    """Return a player's body where a task needs one that is moved by its joints.

    Raises:
        ValueError: If it is not.
    """
    if not isinstance(player.body, Humanoid):
        raise ValueError(
            f"{player.name}: this task needs a body with joints; choose body=full, mitten, "
            "full_limbs or mitten_limbs"
        )
    return player.body


def terms(**weights: float) -> Any:
    """Declare the reward terms of a task and what each is worth."""
    return field(default_factory=lambda: dict(weights))


@dataclass
class TaskCfg:
    """What every task can be told from the command line.

    Attributes:
        name: The task's class name.
        max_seconds: Episodes are truncated after so many simulated seconds.
        weights: What each reward term is worth, by name.
    """

    name: str = ""
    max_seconds: float = 20.0
    weights: dict[str, float] = terms()

    def __post_init__(self) -> None:
        """An episode needs a length, a weight needs a value."""
        self._check_positive("max_seconds")
        bad = {name: value for name, value in self.weights.items() if not math.isfinite(value)}
        if bad:
            raise ValueError(f"task.weights: {bad} must be finite numbers")

    def _check_positive(self, *names: str) -> None:
        """Refuse numbers of these names that are zero, negative or not finite."""
        for name in names:
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"task.{name}={value} must be a positive number")


class Task(ABC):
    """The rules of one game.

    A task never touches torch and never looks up a link: it asks the bodies and the props.

    Attributes:
        teams: Who plays, see also `teams_of`.
        senses: What the players perceive by.
        eliminates: Whether single players may be out while others play on, see `is_out`.
    """

    teams: ClassVar[tuple[Team, ...]] = (Team("agents"),)
    senses: ClassVar[tuple[str, ...]] = ()
    eliminates: ClassVar[bool] = False
    cfg: TaskCfg

    def __init__(self, cfg: TaskCfg, world: World, players: list[Player]) -> None:
        """Take the players into the world and build the rest."""
        known = set(type(self).cfg_type()().weights)
        if set(cfg.weights) != known:
            raise ValueError(
                f"task.weights has the terms {sorted(cfg.weights)}; "
                f"{type(self).__name__} pays {sorted(known)}"
            )
        self.cfg, self.world, self.players = cfg, world, players
        self.build()

    @abstractmethod
    def build(self) -> None:
        """Put the things of this task into the world. Called once."""

    @abstractmethod
    def reset(self, rng: np.random.Generator) -> None:
        """Put everything in its starting place. Called at every episode."""

    def before_step(self, rng: np.random.Generator) -> None:  # noqa: B027  not every task acts
        """Change the world, after the players chose and before the physics moves."""

    def after_step(self, rng: np.random.Generator) -> None:  # noqa: B027  not every task counts
        """Keep the score, after the physics moved and before anyone is paid."""

    @abstractmethod
    def reward(self, player: Player) -> dict[str, float]:
        """Return the terms of one player, unweighted, named as in `cfg.weights`."""

    def terminated(self) -> bool:
        """Say whether the game is over for everyone."""
        return False

    def is_out(self, player: Player) -> bool:
        """Say whether the game is over for one player, for a task that `eliminates`.

        Who is out stays out until the next episode: it rests, perceives zeros and is paid nothing.
        """
        return False

    @classmethod
    def teams_of(cls, cfg: Any) -> tuple[Team, ...]:
        """Return who plays; for a task whose numbers of players are in its configuration."""
        return cls.teams

    @classmethod
    def cfg_type(cls) -> type[TaskCfg]:
        """Return the class this task declares for `cfg`."""
        hint: type[TaskCfg] = get_type_hints(cls)["cfg"]
        return hint


TASKS: Registry[type[Task]] = Registry("task")


def register(task: type[Task]) -> type[Task]:
    """Register a task by its class name.

    Raises:
        ValueError: If another task has this name.
    """
    TASKS.add(task.__name__, task)
    return task


def find_task(name: str) -> type[Task]:
    """Return a task by name; raise `ValueError` with the names that exist."""
    return TASKS.find(name)
