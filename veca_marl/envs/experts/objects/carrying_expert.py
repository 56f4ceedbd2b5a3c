"""Base class of the experts that hold a thing between both palms."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, TaskT
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.palm_motion import PalmMotion
from veca_marl.sim.geometry import Floats


class CarryingExpert(Expert[TaskT]):
    """Commands the joints by a sequence of target angles that starts with each episode.

    It plays at control rates from 21 to 245 Hz, at which its motion takes the same time. Slower
    feedback than that does not balance the trunk: at 15 Hz the body topples or misses the thing.

    Args:
        task: The rules that are played.
        player: The player that the commands are for.
        palms: Controller of both hands.
    """

    reads = ()
    control_rates_hz = (21, 245)

    def __init__(self, task: TaskT, player: Player, palms: PalmMotion) -> None:
        super().__init__(task, player)
        self._palms = palms

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._palms.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    @abstractmethod
    def _script(self) -> Iterator[Floats]:
        """Yield target angles ``(82,)`` in rad, one array per step, without end."""
