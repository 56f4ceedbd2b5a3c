"""Expert of MultiAgentNav: search, call when the object is found, go to calls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.multi_agent_nav import ObjectSearch
from veca_marl.envs.tasks.navigation.multi_agent_nav import MultiAgentNav
from veca_marl.sim.hearing import AudioSense


@register_expert("MultiAgentNav")
class MultiAgentNavExpert(Expert[MultiAgentNav]):
    """Searches the house, calls beside the object, and goes to where calls come from.

    An agent that has seen the object knows its position, goes there, calls while it is in the same
    room, and after its arrival makes space for the others. An agent that has not seen it estimates
    the position of callers from the observation ``audio``: the level falls with distance, by 30 dB
    for each wall, and differs between the ears with the direction. Without calls it turns round
    once in each room, the nearest first. An agent that is stuck moves backwards.

    Reads privileged state: its own position and heading, the floor plan, the places of walls, doors
    and things, and whether the object is visible, where it then is, and which agents have reached
    it. A crawling body needs up to a minute where a walker needs ten seconds.
    """

    reads = ("audio",)

    def reset(self) -> None:
        """See `Expert.reset`."""
        body, world = self.player.body, self.task.world
        locomotion = locomotion_of(self.player, world.clock.step_s)
        ears = self.player.senses.get("audio")
        noise_power = ears.noise_power if isinstance(ears, AudioSense) else 0.0
        self._search = ObjectSearch(body, locomotion, self.task.plan, world, noise_power)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        task, player = self.task, self.player
        seen = task.target.position if task.sees_target(player) else None
        return self._search.command(observation.get("audio"), seen, player.name in task.arrived)
