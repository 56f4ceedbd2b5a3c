"""Sound in a world: moving sources and moving listeners, one control step at a time.

Each listener has its own state: neither the number nor the order of the listeners changes their
signals. Sound advances by the steps of the simulation's clock alone.
"""

from __future__ import annotations

import numpy as np

from veca_marl.sim.sound.delay_lines import HALF_WIDTH
from veca_marl.sim.sound.listener import Listener, SoundClock
from veca_marl.sim.sound.propagation.receiver import Receiver
from veca_marl.sim.sound.rooms import FreeField, House, OneRoom, Room, Surroundings
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.sounds import Sound

__all__ = ["Listener", "SoundField", "Source"]

REACH_M = 200.0
"""Reach of the free field, where a source of level 1 has an rms pressure of 0.005 (-46 dB)."""


class SoundField:
    """The sound sources of a world, the rooms around them and the listeners.

    Attributes:
        sources: Sources by name.
        latency_samples: Delay of all signals beyond the propagation delay; the same for every
            receiver.
    """

    def __init__(
        self,
        room: Room | House | None = None,
        step_samples: int = 882,
        sample_rate_hz: int = 22_050,
        image_order: int = 1,
        reach_m: float = REACH_M,
    ) -> None:
        """Create a field without sources.

        Args:
            room: One room or several; None is the free field.
            step_samples: Samples per control step.
            sample_rate_hz: Sampling rate.
            image_order: Greatest number of reflections of the image sources; a house has its own.
            reach_m: Distance up to which sources are heard in the free field; those beyond are
                silent, with a warning. Rooms have no limit.

        Raises:
            ValueError: If a number is not positive.
        """
        if step_samples < 1 or sample_rate_hz < 1:
            raise ValueError(
                "step_samples and sample_rate_hz must be positive, "
                f"got {step_samples} and {sample_rate_hz}"
            )
        self.sources: dict[str, Source] = {}
        self.latency_samples = HALF_WIDTH
        self._clock = SoundClock(sample_rate_hz, step_samples)
        self._surroundings = _surroundings(room, image_order, reach_m)
        self._listeners: list[Listener] = []
        self._memory_samples = step_samples

    @property
    def step_samples(self) -> int:
        """Samples per control step."""
        return self._clock.step_samples

    @property
    def sample_rate_hz(self) -> int:
        """Sampling rate."""
        return self._clock.sample_rate_hz

    @property
    def clock(self) -> int:
        """Control steps since the reset."""
        return self._clock.steps

    def add_source(self, name: str, sound: Sound) -> Source:
        """Add a source at the origin; set its `position` before every step.

        Raises:
            ValueError: If the name is taken.
        """
        if name in self.sources:
            raise ValueError(f"a source {name!r} exists already; sources: {sorted(self.sources)}")
        source = self.sources[name] = Source(name, sound, self._memory_samples)
        return source

    def remove(self, source: Source) -> None:
        """Remove a source, with its sound that has not arrived yet.

        Raises:
            ValueError: If the source is not in this field.
        """
        if self.sources.get(source.name) is not source:
            raise ValueError(f"no source {source.name!r} here; sources: {sorted(self.sources)}")
        del self.sources[source.name]
        for listener in self._listeners:
            listener.forget(source)

    def add_listener(self, receiver: Receiver, memory_steps: int = 1) -> Listener:
        """Add a pair of ears with a receiver of its own.

        Args:
            receiver: Turns the sound that arrives at the head into two signals.
            memory_steps: How many earlier steps `Listener.rejoin` can return.
        """
        listener = Listener(self.sources, self._surroundings, self._clock, receiver, memory_steps)
        self._listeners.append(listener)
        self._memory_samples = max(self._memory_samples, listener.memory_samples)
        for source in self.sources.values():
            source.keep(self._memory_samples)
        return listener

    def reset(self, rng: np.random.Generator) -> None:
        """Clear all sound that is under way, restart all sounds and reset all listeners.

        Args:
            rng: Source of the sounds' phases and noises.
        """
        self._clock.steps = 0
        for source in self.sources.values():
            source.reset(rng)
        for listener in self._listeners:
            listener.reset()

    def advance(self) -> None:
        """Let every source emit one control step of sound."""
        self._clock.steps += 1
        for source in self.sources.values():
            source.advance(self.step_samples)


def _surroundings(room: Room | House | None, image_order: int, reach_m: float) -> Surroundings:
    if isinstance(room, House):
        return room
    return FreeField(reach_m) if room is None else OneRoom(room, image_order)
