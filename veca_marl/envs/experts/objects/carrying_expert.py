"""What the experts that carry a thing between both palms have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, TaskT
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.skills.carrying import Carrier
from veca_marl.sim.geometry import Floats


class CarryingExpert(Expert[TaskT]):
    """Commands the joints by a sequence of target angles that starts anew in each episode.

    Args:
        task: The rules that are played.
        player: The player that the commands are for.
        carrier: Controller of both hands.
    """

    reads = ()

    def __init__(self, task: TaskT, player: Player, carrier: Carrier) -> None:
        super().__init__(task, player)
        self._carrier = carrier

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._carrier.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    @abstractmethod
    def _script(self) -> Iterator[Floats]:
        """Yield target angles ``(82,)`` in rad, one array per step, without end."""
