"""Sound in a world: moving sources and moving listeners, one control step at a time.

Each listener has its own state: neither the number nor the order of the listeners changes their
signals. Sound advances by the steps of the simulation's clock alone.
"""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound.acoustics import SPEED_OF_SOUND_MPS, Room
from veca_marl.sim.sound.fractional_delay import HALF_WIDTH, KERNEL_LATENCY, KERNEL_TAPS
from veca_marl.sim.sound.house import House
from veca_marl.sim.sound.propagation import OneRoom, Path, StreamFormat, Surroundings
from veca_marl.sim.sound.receiver import Receiver, lead_samples
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.sounds import Sound

__all__ = ["Listener", "SoundField", "Source"]


class SoundField:
    """The sound sources of a world, the rooms around them and the listeners.

    Attributes:
        sources: Sources by name.
        step_samples: Samples per control step.
        sample_rate_hz: Sampling rate.
        clock: Control steps since the reset.
        latency_samples: Delay of all signals beyond the propagation delay; the same for every
            receiver.
    """

    def __init__(
        self,
        room: Room | House | None = None,
        step_samples: int = 882,
        sample_rate_hz: int = 22_050,
        image_order: int = 1,
        reach_m: float = 60.0,
    ) -> None:
        """Create a field without sources.

        Args:
            room: One room or several; None is the free field.
            step_samples: Samples per control step.
            sample_rate_hz: Sampling rate.
            image_order: Greatest number of reflections of the image sources; a house has its own.
            reach_m: Distance up to which the propagation delay grows; sound from further away
                has the delay of this distance. The diagonal of the rooms if that is less.

        Raises:
            ValueError: If a number is not positive.
        """
        if step_samples < 1 or sample_rate_hz < 1 or reach_m <= 0.0:
            raise ValueError(
                "step_samples, sample_rate_hz and reach_m must be positive, "
                f"got {step_samples}, {sample_rate_hz}, {reach_m}"
            )
        self.sources: dict[str, Source] = {}
        self.step_samples = step_samples
        self.sample_rate_hz = sample_rate_hz
        self.clock = 0
        self.latency_samples = HALF_WIDTH + KERNEL_LATENCY + lead_samples(sample_rate_hz)
        self._surroundings: Surroundings = (
            room if isinstance(room, House) else OneRoom(room, image_order)
        )
        self._listeners: list[Listener] = []
        if room is not None:
            reach_m = min(reach_m, float(np.linalg.norm(room.size)))
        longest_delay = int(np.ceil(reach_m * sample_rate_hz / SPEED_OF_SOUND_MPS))
        self._history_samples = longest_delay + step_samples + 2 * KERNEL_TAPS
        self._memory_samples = self._history_samples

    def add_source(self, name: str, sound: Sound) -> Source:
        """Add a source at the origin; set its `position` before every step.

        Raises:
            ValueError: If the name is taken.
        """
        if name in self.sources:
            raise ValueError(f"a source {name!r} exists already; sources: {sorted(self.sources)}")
        source = Source(name, sound, self._history_samples)
        source.keep(self._memory_samples)
        self.sources[name] = source
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
        listener = Listener(self, self._surroundings, receiver, memory_steps)
        self._listeners.append(listener)
        heard_from = self._history_samples + listener.block_samples
        needed = heard_from + memory_steps * self.step_samples
        self._memory_samples = max(self._memory_samples, needed)
        for source in self.sources.values():
            source.keep(self._memory_samples)
        return listener

    def reset(self, rng: np.random.Generator) -> None:
        """Clear all sound that is under way, restart all sounds and reset all listeners.

        Args:
            rng: Source of the sounds' phases and noises.
        """
        self.clock = 0
        for source in self.sources.values():
            source.reset(rng)
        for listener in self._listeners:
            listener.reset()

    def advance(self) -> None:
        """Let every source emit one control step of sound."""
        self.clock += 1
        for source in self.sources.values():
            source.advance(self.step_samples)


class Listener:
    """One pair of ears. Made by `SoundField.add_listener`."""

    def __init__(
        self,
        field: SoundField,
        surroundings: Surroundings,
        receiver: Receiver,
        memory_steps: int = 1,
    ) -> None:
        self._field = field
        self._memory_steps = memory_steps
        self._surroundings = surroundings
        self._receiver = receiver
        n = field.step_samples
        self._stream = StreamFormat.for_listener(receiver, surroundings, field.sample_rate_hz, n)
        self._fade = np.arange(1, n + 1, dtype=np.float32) / np.float32(n)
        self._paths: dict[str, Path] = {}
        self._clock = field.clock

    def reset(self) -> None:
        """Clear the signals and the last positions of all sources."""
        for path in self._paths.values():
            path.reset()
        self._clock = self._field.clock

    def forget(self, source: Source) -> None:
        """Drop the state that belongs to a source."""
        self._paths.pop(source.name, None)

    @property
    def block_samples(self) -> int:
        """How many samples of a delayed source are filtered at once."""
        return self._stream.block_samples

    @property
    def missed_steps(self) -> int:
        """How many control steps before the present one were not rendered."""
        return max(self._field.clock - self._clock - 1, 0)

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
        n, heard = self._field.step_samples, []
        for age in range(n_steps, 0, -1):
            audible = [path for path in self._all_paths() if path.rejoin(head, age * n)]
            heard.append(self._mix(audible) if audible else np.zeros((2, n), np.float32))
        self._clock = self._field.clock - 1
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
        silence = np.zeros((2, self._field.step_samples), np.float32)
        if self._field.clock == 0:
            return silence
        if self._field.clock != self._clock + 1:
            raise RuntimeError(
                f"a listener renders every control step once: it rendered step {self._clock}, the "
                f"field is at step {self._field.clock}; call rejoin() after steps left out"
            )
        self._clock = self._field.clock
        heard = [path for path in self._all_paths() if path.advance(head)]
        return self._mix(heard) if heard else silence

    def _all_paths(self) -> list[Path]:
        for name, source in self._field.sources.items():
            if name not in self._paths:
                self._paths[name] = Path(source, self._surroundings, self._receiver, self._stream)
        return list(self._paths.values())

    def _mix(self, paths: list[Path]) -> NDArray[np.float32]:
        """Filter all blocks, add them and cross-fade from the old filters to the new."""
        n, block = self._stream.step_samples, self._stream.block_samples
        sound = scipy.fft.rfft(np.stack([path.block for path in paths]))
        after = sum(s * path.response for s, path in zip(sound, paths, strict=True))
        if not any(path.moved for path in paths):
            return self._both_ears(scipy.fft.irfft(after, block)[:, -n:])
        before = sum(s * path.response_before for s, path in zip(sound, paths, strict=True))
        old, new = scipy.fft.irfft(np.stack([before, after]), block)[..., -n:]
        return self._both_ears(old + (new - old) * self._fade)

    @staticmethod
    def _both_ears(channels: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.repeat(channels, 2, axis=0) if len(channels) == 1 else channels
