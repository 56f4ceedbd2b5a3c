"""Tasks: teams and players, the base class of all rules, required bodies, and the registry."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, TypeVar, get_type_hints

import numpy as np

from veca_marl.registry import Registry
from veca_marl.sim.body import Body, BodyCfg
from veca_marl.sim.body.action import VoiceKind
from veca_marl.sim.body.anatomy import REFERENCE, Growth, growth_at
from veca_marl.sim.body.anatomy.growth import OLDEST_MONTHS, YOUNGEST_MONTHS
from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import ClockCfg, PlaygroundCfg, World
from veca_marl.sim.sense import Sense

_KINDS: dict[type[BodyCfg], str] = {
    WalkerCfg: "a body that walks; choose body=walker",
    HumanoidCfg: "a body with joints; choose body=full, mitten, full_limbs or mitten_limbs",
}


def check_body(
    owner: str,
    body: BodyCfg,
    needed: type[BodyCfg],
    verbs: Sequence[str] = (),
    needs_voice: bool = False,
) -> None:
    """Check that a body is of the kind that a task needs, with the verbs and the voice it needs.

    Args:
        owner: The team or the player, for the message.
        body: Parameters of the body; their class is its kind.
        needed: The class that is needed; `BodyCfg` for any.
        verbs: Choices of the action part `verb` that are needed.
        needs_voice: Whether the action part `voice` is needed.

    Raises:
        ValueError: If the body is of another kind, lacks a verb or a voice, or its verbs reach
            nothing.
    """
    if not isinstance(body, needed):
        raise wrong_body(owner, needed)
    if needs_voice and body.voice is not VoiceKind.calls:
        raise ValueError(
            f"{owner}: this task needs a voice; choose body.voice=calls, or a body such as "
            "walker_voice, walker_discrete_voice, mitten_voice or full_voice"
        )
    own = list(getattr(body, "verbs", ()))
    missing = sorted(set(verbs) - set(own))
    if missing:
        raise ValueError(
            f"{owner}: this task needs the verbs {list(verbs)}; body.verbs={own} lacks {missing}"
        )
    if verbs and not body.interaction_range_m > 0.0:
        raise ValueError(
            f"{owner}: this task needs the verbs {list(verbs)}, which reach nothing with "
            f"body.interaction_range_m={body.interaction_range_m}"
        )


def check_size(owner: str, growth: Growth, ages_months: tuple[float, float] | None) -> None:
    """Check that a task can be played with a body of a size.

    Args:
        owner: The team or the player, for the message.
        growth: The size.
        ages_months: See `Task.ages_months`.

    Raises:
        ValueError: If it cannot.
    """
    if growth == REFERENCE:
        return
    if ages_months is None:
        raise ValueError(
            f"{owner}: this task is for the body of 0.78 m, this one is {growth.height_m:.3g} m "
            "high: its distances and objects do not grow with the body yet; leave out "
            "development, body.age_months and body.height_m"
        )
    least, most = (growth_at(age).height_m for age in ages_months)
    if not least <= growth.height_m <= most:
        raise ValueError(
            f"{owner}: this task is for bodies from {ages_months[0]:g} to {ages_months[1]:g} "
            f"months, {least:.3g} to {most:.3g} m high; this one is {growth.height_m:.3g} m high"
        )


def wrong_body(owner: str, needed: type[BodyCfg]) -> ValueError:
    """Return the error for a body of another kind than is needed, see `check_body`."""
    kind = _KINDS.get(needed, f"a body whose parameters are a {needed.__name__}")
    return ValueError(f"{owner}: this task needs {kind}")


TaskType = TypeVar("TaskType", bound="type[Task]")

SOLVED = "solved"
"""Name of the entry of `info` that holds the result of `Task.solved`."""


class Team(NamedTuple):
    """Players that share specs and a policy; a team is one TorchRL group.

    Attributes:
        name: Name of the team, unique in its task.
        size: Number of players.
        senses: Senses of its players; None takes those of the task.
        shirt: Index of the colour of the shirts (blue, red, green, yellow); None takes the index
            of the team.
    """

    name: str
    size: int = 1
    senses: tuple[str, ...] | None = None
    shirt: int | None = None


class Player(NamedTuple):
    """One body in one team.

    Attributes:
        name: Unique in its game.
        team: The name of its team.
        body: Its body.
        senses: Its senses by name. They are made after the task: empty while it is built.
    """

    name: str
    team: str
    body: Body
    senses: Mapping[str, Sense] = MappingProxyType({})


def require_walker(player: Player) -> Walker:
    """Return the body of a player, which walks, see `Task.body_cfg`.

    Raises:
        ValueError: If the body is of another kind.
    """
    if not isinstance(player.body, Walker):
        raise wrong_body(player.name, WalkerCfg)
    return player.body


def require_humanoid(player: Player) -> Humanoid:
    """Return the body of a player, which is controlled by its joints, see `Task.body_cfg`.

    Raises:
        ValueError: If the body is of another kind.
    """
    if not isinstance(player.body, Humanoid):
        raise wrong_body(player.name, HumanoidCfg)
    return player.body


RATE_STEP_S = 0.04
"""Duration of the step for which weights of rates are given, which is that of the default clock."""

GREATEST_WEIGHT = 1e30
"""Rewards are float32, which ends at 3e38."""

GREATEST_NUMBER = 1e9
"""Of any distance, angle, time or mass of a task; sums and differences of larger ones overflow."""

LONGEST_EPISODE_S = 1e9
"""Thirty years; the steps of an episode are counted."""


def terms(**weights: float) -> Any:
    """Declare the reward terms of a task with the default weight of each."""
    return field(default_factory=lambda: dict(weights))


@dataclass
class TaskCfg:
    """Parameters that all tasks have.

    Attributes:
        name: Class name of the task.
        max_seconds: Simulated time after which an episode is truncated.
        weights: Weight of each reward term by its name; the reward is the weighted sum. For the
            terms in `Task.rates` it is that of a step of 40 ms.
    """

    name: str = ""
    max_seconds: float = 20.0
    weights: dict[str, float] = terms()

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: If the duration is not positive, a weight is not finite or huge, or a term
                is named `solved`, as another entry of `info`; `Task` checks the entries of bodies.
        """
        self.check_positive("max_seconds")
        if self.max_seconds > LONGEST_EPISODE_S:
            raise ValueError(
                f"task.max_seconds={self.max_seconds:g} must be at most {LONGEST_EPISODE_S:g}"
            )
        if SOLVED in self.weights:
            raise ValueError(f"task.weights: {SOLVED!r} is the name of another entry of info")
        bad = {n: value for n, value in self.weights.items() if not abs(value) <= GREATEST_WEIGHT}
        if bad:
            raise ValueError(f"task.weights: {bad} must be numbers of at most {GREATEST_WEIGHT:g}")

    def check_positive(self, *names: str) -> None:
        """Raise `ValueError` if a field is zero, negative or above `GREATEST_NUMBER`."""
        for name in names:
            value = getattr(self, name)
            if not 0.0 < value <= GREATEST_NUMBER:
                raise ValueError(
                    f"task.{name}={value} must be a positive number of at most {GREATEST_NUMBER:g}"
                )

    def check_not_negative(self, *names: str) -> None:
        """Raise `ValueError` if a field is negative, also as -0.0, or above `GREATEST_NUMBER`."""
        for name in names:
            value = getattr(self, name)
            if not 0.0 <= value <= GREATEST_NUMBER or math.copysign(1.0, value) < 0.0:
                raise ValueError(
                    f"task.{name}={value} must be 0 or more, and at most {GREATEST_NUMBER:g}"
                )

    def _check_span(self, name: str, lowest: float, condition: str) -> None:
        """Raise `ValueError` if a field is no pair (least, greatest) of at least `lowest`."""
        least, greatest = getattr(self, name)
        if not lowest <= least <= greatest < math.inf:
            raise ValueError(
                f"task.{name}={(least, greatest)} must be (least, greatest), {condition}"
            )


class Task(ABC):
    """The rules of one game.

    A task reads and places bodies and props through their public methods. It does not use torch,
    Bullet or indices of links.

    Attributes:
        teams: The teams, see also `teams_of`.
        senses: Senses of the players.
        body_cfg: Class of the parameters of the bodies that can play it: `WalkerCfg`,
            `HumanoidCfg`, or `BodyCfg` for any.
        ages_months: Least and greatest age of the size of the bodies that can play it; None if
            that is only the body of 0.78 m. The rules of such a task do not fit other sizes.
        verbs: Choices of the action part `verb` that it needs.
        needs_voice: Whether it needs the action part `voice`, with which bodies call.
        rates: Names of the reward terms that are earned as long as a state lasts, such as a speed
            or a height, and not by a change or an event. Their weights are for a step of
            `RATE_STEP_S`; with another clock they are proportional to the duration of a step, so
            that an episode of equal motion has an equal return.
        eliminates: Whether the game can end for single players, see `is_eliminated`.
        suite: Name of the collection of tasks that it belongs to, see `veca_marl.list_tasks`.
        cfg: Parameters of the task. Subclasses annotate it with their own dataclass.
        world: The world.
        players: All players, team by team.
    """

    teams: ClassVar[tuple[Team, ...]] = (Team("agents"),)
    senses: ClassVar[tuple[str, ...]] = ()
    body_cfg: ClassVar[type[BodyCfg]] = BodyCfg
    ages_months: ClassVar[tuple[float, float] | None] = (YOUNGEST_MONTHS, OLDEST_MONTHS)
    verbs: ClassVar[tuple[str, ...]] = ()
    needs_voice: ClassVar[bool] = False
    rates: ClassVar[tuple[str, ...]] = ()
    eliminates: ClassVar[bool] = False
    suite: ClassVar[str] = "veca"
    cfg: TaskCfg

    def __init__(self, cfg: TaskCfg, world: World, players: list[Player]) -> None:
        """Store the arguments and build the props.

        Raises:
            ValueError: If the names of the weights are not those of the reward terms, `rates` names
                another term, a body reports a number of the name of a term, or `is_eliminated` is
                defined without `eliminates`.
        """
        self._check_elimination()
        self._check_terms(cfg, players)
        self.cfg, self.world, self.players = cfg, world, players
        self.build()

    def _check_elimination(self) -> None:
        """Raise `ValueError` if `is_eliminated` would never be called."""
        if type(self).is_eliminated is not Task.is_eliminated and not self.eliminates:
            raise ValueError(
                f"{type(self).__name__} defines is_eliminated, but has eliminates=False: no player "
                "would be eliminated; set eliminates = True in the class"
            )

    def _check_terms(self, cfg: TaskCfg, players: list[Player]) -> None:
        """Raise `ValueError` if weights, rates or bodies do not agree with the reward terms."""
        name, known = type(self).__name__, set(type(self).cfg_type()().weights)
        if set(cfg.weights) != known:
            raise ValueError(
                f"task.weights has the terms {sorted(cfg.weights)}; {name} has {sorted(known)}"
            )
        if unknown := sorted(set(self.rates) - known):
            raise ValueError(f"{name}.rates names {unknown}; its reward terms are {sorted(known)}")
        _check_info(known, players)

    @classmethod
    def step_weights(cls, cfg: TaskCfg, clock: ClockCfg) -> dict[str, float]:
        """Return the weight of each reward term in a step of a clock, see `rates`."""
        duration = clock.step_s / RATE_STEP_S
        return {
            name: weight * duration if name in cls.rates else weight
            for name, weight in cfg.weights.items()
        }

    @abstractmethod
    def build(self) -> None:
        """Add the props of this task to the world. Called once per world."""

    @abstractmethod
    def reset(self, rng: np.random.Generator) -> None:
        """Place bodies and props for an episode. Called at the start of each episode."""

    def before_step(self, rng: np.random.Generator) -> None:  # noqa: B027  optional
        """Change the world after the actions have been set and before the physics is simulated."""

    def after_step(self, rng: np.random.Generator) -> None:  # noqa: B027  optional
        """Update the score after the physics has been simulated and before `reward` is called."""

    @abstractmethod
    def reward(self, player: Player) -> dict[str, float]:
        """Return the unweighted reward terms of one player, named as in `TaskCfg.weights`."""

    def state(self) -> dict[str, float]:
        """Return numbers on the task that no pose shows, for central critics; see `GlobalState`.

        The names are always the same: times and counts that rewards depend on, for example.
        """
        return {}

    def terminated(self) -> bool:
        """Return whether the game has ended by its rules for all players."""
        return False

    def solved(self, player: Player) -> bool | None:
        """Return whether the goal of the task is reached for a player at this moment.

        An episode counts as solved if this is True after its last step. A task with a goal
        overrides this method and returns a bool for every player after every step; a task without
        one does not, and the result is None.
        """
        return None

    @classmethod
    def has_goal(cls) -> bool:
        """Return whether the task defines `solved`."""
        return cls.solved is not Task.solved

    def is_eliminated(self, player: Player) -> bool:
        """Return whether the game has ended for one player, in a task that `eliminates`.

        From then until the end of the episode the player rests, its observation is zero and its
        reward is zero.
        """
        return False

    @classmethod
    def teams_of(cls, cfg: Any) -> tuple[Team, ...]:
        """Return the teams; overridden where their sizes depend on the configuration."""
        return cls.teams

    @classmethod  # noqa: B027  optional
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        """Check that the task can be played in a playground, before a world is built.

        Raises:
            ValueError: If not; the message names the value that is impossible and the choices.
        """

    @classmethod  # noqa: B027  optional
    def check_distances(
        cls, cfg: Any, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
    ) -> None:
        """Check that the distances of the task fit the size of the bodies, by team name.

        Called after `check_playground`, before a world is built.

        Raises:
            ValueError: If not; the message names the value that is impossible and the choices.
        """

    @classmethod  # noqa: B027  optional
    def check_clock(cls, cfg: Any, clock: ClockCfg) -> None:
        """Check that the numbers of the task fit the time steps, before a world is built.

        Raises:
            ValueError: If not; the message names the value that is impossible and the choices.
        """

    @classmethod
    def cfg_type(cls) -> type[TaskCfg]:
        """Return the class with which this task annotates `cfg`."""
        hint: type[TaskCfg] = get_type_hints(cls)["cfg"]
        return hint


def _check_info(names: set[str], players: list[Player]) -> None:
    """Raise `ValueError` if a body reports a number of the name of a reward term."""
    for player in players:
        both = sorted(names.intersection(player.body.info()))
        if both:
            raise ValueError(
                f"task.weights: {both} are the names of other entries of info, which the body of "
                f"{player.name!r} reports; choose other names of terms"
            )


TASKS: Registry[type[Task]] = Registry("task")


def register_task(task: TaskType) -> TaskType:
    """Register a task by its class name; a class decorator.

    Raises:
        ValueError: If another task has this name.
    """
    TASKS.add(task.__name__, task)
    return task


def find_task(name: str) -> type[Task]:
    """Return a task by its class name.

    Raises:
        ValueError: If there is none; the message lists the names.
    """
    return TASKS.find(name)


def cosine(a: Floats, b: Floats) -> float:
    """Return the cosine of the angle between two vectors; 0 if one of them has length 0."""
    length = norm(a) * norm(b)
    return float(a.dot(b)) / length if length > 1e-9 else 0.0


def horizontal_angle_rad(a: Floats, b: Floats) -> float:
    """Return the angle in [0, pi] between the horizontal parts of two vectors.

    Returns 0 if one of the horizontal parts has length 0.
    """
    cross = a[0] * b[1] - a[1] * b[0]
    return math.atan2(abs(cross), a[:2].dot(b[:2]))


def norm(vector: Floats) -> float:
    """Return the length of a vector: bit-equal to `np.linalg.norm`, and faster."""
    return math.sqrt(vector.dot(vector))


def horizontal(vector: Floats) -> Floats:
    """Return a vector ``(3,)`` with its vertical component set to 0."""
    return np.array([vector[0], vector[1], 0.0])


def clipped_share(value: float, whole: float) -> float:
    """Return ``value / whole``, clipped to [0, 1]."""
    return float(min(max(value / whole, 0.0), 1.0))


def rotation_angle_rad(a: Floats, b: Floats) -> float:
    """Return the angle in [0, pi] of the rotation between two orientations ``(3, 3)``."""
    cosine_of_angle = (float(np.vdot(a, b)) - 1.0) / 2.0
    return math.acos(min(max(cosine_of_angle, -1.0), 1.0))
