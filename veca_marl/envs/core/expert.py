"""Scripted policies: the base class `Expert` and the registry that finds the expert of a task."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Generic, TypeVar

from numpy.typing import NDArray

from veca_marl.envs.core.task import Player, Task
from veca_marl.registry import Registry
from veca_marl.sim.physics import ClockCfg

TaskT = TypeVar("TaskT", bound=Task)
ExpertT = TypeVar("ExpertT", bound="type[Expert[Any]]")


class Expert(ABC, Generic[TaskT]):
    """A scripted policy for one player of one task.

    Experts serve as opponents, as demonstrators and as a check that a task can be solved. They may
    read privileged state of the task and its bodies; the docstring of each class states which.
    An expert keeps its own state and draws no random numbers.

    Attributes:
        reads: Names of the senses that `act` reads; the game computes no others for it. None is
            all senses of the player.
        needs: Names of the senses without which it cannot play.
        control_rates_hz: Least and greatest control rate, agent steps per second, at which it can
            play, see `ClockCfg.control_rate_hz`; None is every rate.
        task: The rules that are played.
        player: The player that the commands are for.
    """

    reads: ClassVar[tuple[str, ...] | None] = None
    needs: ClassVar[tuple[str, ...]] = ()
    control_rates_hz: ClassVar[tuple[int, int] | None] = None

    def __init__(self, task: TaskT, player: Player) -> None:
        self.task, self.player = task, player

    def reset(self) -> None:
        """Prepare for an episode. Called after the task and the senses have been reset."""

    @abstractmethod
    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return the command for the next step. Called once per step.

        Args:
            observation: What the senses in `reads` observe, by key; more may be in it.

        Returns:
            A command that `Body.encode` turns into an action. For a walker, ``(forward, turn)``,
            each in [-1, 1], optionally followed by a `Call`. For a joint-level body, the target
            angles of the 82 joints in rad, ``(82,)``, or a `JointCommand`; both serve
            torque-controlled and position-controlled bodies.
        """

    def follow_body(self) -> None:
        """Continue from the state of the body; nothing by default.

        Called before `act` if the last action of the player was not the one that `act` returned, as
        in DAgger, where a policy acts and the expert only labels. An expert with a clock, such as a
        gait, sets it to the phase of the body: labels that depend on a clock which the policy does
        not observe cannot be learnt.
        """


EXPERTS: Registry[type[Expert[Any]]] = Registry("expert of task")


def register_expert(task: str) -> Callable[[ExpertT], ExpertT]:
    """Return a class decorator that registers an `Expert` for a task.

    Args:
        task: Class name of the task.

    Raises:
        ValueError: When the decorator is applied, if the task has another expert.
    """

    def decorate(expert: ExpertT) -> ExpertT:
        EXPERTS.add(task, expert)
        return expert

    return decorate


def has_expert(task: str) -> bool:
    """Return whether a task, named by its class name, has an expert."""
    return task in EXPERTS


def find_expert(task: str) -> type[Expert[Any]]:
    """Return the expert of a task.

    Args:
        task: Class name of the task.

    Raises:
        ValueError: If the task has no expert; the message lists the tasks that have one.
    """
    if task not in EXPERTS:
        raise ValueError(f"task {task!r} has no expert; tasks with an expert: {sorted(EXPERTS)}")
    return EXPERTS[task]


def missing_needs(expert: type[Expert[Any]], player: Player, clock: ClockCfg) -> list[str]:
    """Return what an expert needs to play a player and does not have; empty if it can play.

    Args:
        expert: The expert.
        player: The player.
        clock: The clock of the world.

    Returns:
        Names of senses, and the control rates at which it can play.
    """
    return [*_missing_senses(expert, player), *_missing_rates(expert, clock)]


def check_expert(expert: type[Expert[Any]], player: Player, clock: ClockCfg) -> None:
    """Check that an expert can play a player.

    Args:
        expert: The expert.
        player: The player.
        clock: The clock of the world.

    Raises:
        ValueError: If a sense is missing that it needs, or it cannot play at the control rate.
    """
    if missing := _missing_senses(expert, player):
        raise ValueError(
            f"{expert.__name__} needs {', '.join(missing)}, which {player.name} has not; "
            f"its senses: {', '.join(player.senses) or 'none'}"
        )
    if rates := _missing_rates(expert, clock):
        raise ValueError(
            f"{expert.__name__} needs {rates[0]}, not {clock.control_rate_hz}: its motion fails at "
            "other control rates; the default is 25"
        )


def _missing_senses(expert: type[Expert[Any]], player: Player) -> list[str]:
    return [name for name in expert.needs if name not in player.senses]


def _missing_rates(expert: type[Expert[Any]], clock: ClockCfg) -> list[str]:
    """Return the control rates at which an expert can play; empty if that of the clock is one."""
    rates = expert.control_rates_hz
    if rates is None or rates[0] <= clock.control_rate_hz <= rates[1]:
        return []
    return [f"clock.control_rate_hz from {rates[0]} to {rates[1]}"]
