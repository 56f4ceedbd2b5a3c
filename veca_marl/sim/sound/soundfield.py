"""Sound in a world: moving sources and moving listeners, one control step at a time.

Each listener has its own state: neither the number nor the order of the listeners changes their
signals. Sound advances by the steps of the simulation's clock alone.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound.house import House
from veca_marl.sim.sound.propagation import Ears, Propagation, Receiver
from veca_marl.sim.sound.room_acoustics import Room
from veca_marl.sim.sound.signal_paths import HALF_WIDTH, make_mixer
from veca_marl.sim.sound.sounds import Sound, Source
from veca_marl.sim.sound.surroundings import FreeField, OneRoom, Surroundings

REACH_M = 200.0
"""Reach of the free field, where a source of level 1 has an rms pressure of 0.005 (-46 dB)."""


@dataclass
class SoundClock:
    """The clock of a sound field.

    Attributes:
        sample_rate_hz: Sampling rate.
        step_samples: Samples per control step.
        steps: Control steps since the reset.
    """

    sample_rate_hz: int
    step_samples: int
    steps: int = 0


class Listener:
    """One pair of ears. Made by `SoundField.add_listener`."""

    def __init__(
        self,
        sources: Mapping[str, Source],
        surroundings: Surroundings,
        clock: SoundClock,
        receiver: Receiver,
        memory_steps: int = 1,
        deaf_to: Container[str] = (),
    ) -> None:
        self._sources = sources
        self._deaf_to = deaf_to
        self._clock = clock
        self._memory_steps = memory_steps
        n = clock.step_samples
        self._mixer = make_mixer(receiver.n_channels, receiver.n_taps, n)
        self._ears = Ears(receiver, surroundings, self._mixer, clock.sample_rate_hz, n)
        self._propagations: dict[str, Propagation] = {}
        self._rendered_steps = clock.steps

    def reset(self) -> None:
        """Clear the signals and the last positions of all sources."""
        for propagation in self._propagations.values():
            propagation.reset()
        self._rendered_steps = self._clock.steps

    def teleport(self) -> None:
        """Let the next step be heard from elsewhere without a Doppler shift: sounds are faded over.

        As `Source.teleport` for a head that is moved at once.
        """
        self._ears.teleports += 1

    def forget(self, source: Source) -> None:
        """Drop the state that belongs to a source."""
        self._propagations.pop(source.name, None)

    @property
    def memory_samples(self) -> int:
        """How many samples of each source it needs."""
        return self._ears.reach_samples + self._memory_steps * self._clock.step_samples

    @property
    def missed_steps(self) -> int:
        """How many control steps before the present one were not rendered."""
        return max(self._clock.steps - self._rendered_steps - 1, 0)

    def rejoin(self, head: Pose, n_steps: int = 1) -> NDArray[np.float32]:
        """Render steps that were left out; `render` then continues with the present one.

        Head, sources and obstacles count as having been where they are now. This is exact where
        nothing moved; moving sources have no Doppler shift in those steps.

        Args:
            head: See `render`.
            n_steps: How many steps to return, at most the `memory_steps` of `add_listener`.

        Returns:
            ``(2, n_steps * step_samples)`` sound pressure of the steps before the present one.

        Raises:
            ValueError: If `n_steps` is not from 1 to `memory_steps`.
        """
        if not 1 <= n_steps <= self._memory_steps:
            raise ValueError(f"n_steps={n_steps} must be from 1 to {self._memory_steps}")
        n, heard = self._clock.step_samples, []
        for age in range(n_steps, 0, -1):
            audible = [p.add_past_step(head, age * n) for p in self._all_propagations()]
            heard.append(self._mixed(any(audible)))
        self._rendered_steps = self._clock.steps - 1
        return np.concatenate(heard, axis=1)

    def render(self, head: Pose) -> NDArray[np.float32]:
        """Render one control step. Call once after each `SoundField.advance`.

        The result is silence directly after a reset, before anything was emitted.

        Args:
            head: Midpoint between the ears and rotation of the head at the end of the step.

        Returns:
            ``(2, step_samples)`` sound pressure at the left and right ear, see `waveforms` for its
            unit; exactly 0 where nothing is audible.

        Raises:
            RuntimeError: If a step was left out or is rendered twice.
        """
        steps = self._clock.steps
        if steps == 0:
            return self._mixed(False)
        if steps != self._rendered_steps + 1:
            raise RuntimeError(
                f"a listener renders every control step once: it rendered step "
                f"{self._rendered_steps}, the field is at step {steps}; call rejoin() after steps "
                "left out"
            )
        self._rendered_steps = steps
        audible = [propagation.add_step(head) for propagation in self._all_propagations()]
        return self._mixed(any(audible))

    def _all_propagations(self) -> list[Propagation]:
        for name, source in self._sources.items():
            if name not in self._propagations and name not in self._deaf_to:
                self._propagations[name] = Propagation(source, self._ears)
        return list(self._propagations.values())

    def _mixed(self, audible: bool) -> NDArray[np.float32]:
        if not audible:
            return np.zeros((2, self._clock.step_samples), np.float32)
        channels = self._mixer.finish()
        return np.repeat(channels, 2, axis=0) if len(channels) == 1 else channels


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

    def add_listener(
        self, receiver: Receiver, memory_steps: int = 1, deaf_to: Container[str] = ()
    ) -> Listener:
        """Add a pair of ears with a receiver of its own.

        Args:
            receiver: Turns the sound that arrives at the head into two signals.
            memory_steps: How many earlier steps `Listener.rejoin` can return.
            deaf_to: Names of sources that these ears do not hear; read when a source is first
                heard.
        """
        listener = Listener(
            self.sources, self._surroundings, self._clock, receiver, memory_steps, deaf_to
        )
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
