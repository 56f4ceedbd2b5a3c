"""Propagation: the direct sound and the reflections of one source on their way to one listener."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.partitions import N_BANDS
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.sound.shading import (
    SETTLING_SAMPLES,
    Sections,
    read_shaded_block,
    settle,
    shelf_design,
    shelf_filters,
    unshaded,
)
from veca_marl.sim.sound.signal_paths import (
    KERNEL_TAPS,
    Mixer,
    SignalMemory,
    copy_samples,
    read_moving,
)
from veca_marl.sim.sound.sounds import Source
from veca_marl.sim.sound.surroundings import Arrivals, Surroundings

MAX_SPEED_MPS = 50.0
"""A path of which the length changes faster is cross-faded as a new path, without Doppler shift."""

Place = tuple[int, int, int, bytes, bytes, bytes]


class Receiver(Protocol):
    """Ears of one quality. Stateless: listeners may share one.

    Attributes:
        n_channels: 2, or 1 where both ears have the same signal.
        n_taps: Length of the filter of one path; 1 for a gain without a filter.
        extent_m: Greatest length by which the path to an ear exceeds the one to the head's centre.
    """

    n_channels: int
    n_taps: int
    extent_m: float

    def write_paths(
        self,
        arrivals: Floats,
        gains: Floats,
        sample_rate_hz: float,
        delays: Floats,
        filters: NDArray[np.float32],
    ) -> None:
        """Write the delay and the filter of each path to each channel.

        Args:
            arrivals: ``(K, 3)`` metres from the head's centre to the source and its images, in
                the head frame.
            gains: ``(K,)`` pressure gain of each by the walls.
            sample_rate_hz: Sampling rate.
            delays: ``(K, n_channels)`` samples from the emission to the arrival at the ear, not
                negative; overwritten.
            filters: ``(K, n_channels, n_taps)`` impulse responses without that delay; gain and
                attenuation by distance are included; overwritten.
        """
        ...


class Ears:
    """What all paths to one listener share.

    Attributes:
        mixer: Filters and adds the sound of all paths.
        reach_samples: How many of the newest samples of a source can be heard in one step.
        teleports: How often the head was teleported.
    """

    def __init__(
        self,
        receiver: Receiver,
        surroundings: Surroundings,
        mixer: Mixer,
        sample_rate_hz: float,
        step_samples: int,
    ) -> None:
        self.mixer = mixer
        self.teleports = 0
        self._receiver = receiver
        self._surroundings = surroundings
        self._sample_rate_hz = sample_rate_hz
        self.step_samples = step_samples
        self._shelves = shelf_design(sample_rate_hz)
        samples_per_metre = sample_rate_hz / SPEED_OF_SOUND_MPS
        longest = (surroundings.longest_path_m + receiver.extent_m) * samples_per_metre
        self.reach_samples = self.reach_of(longest)
        self.max_delay_change = MAX_SPEED_MPS * samples_per_metre * step_samples / sample_rate_hz
        self._blocks: dict[int, NDArray[np.float32]] = {}

    def reach_of(self, delay: float) -> int:
        """Return how many of the newest samples can be heard in one step at a delay in samples."""
        return int(np.ceil(delay)) + self.mixer.block_samples + 2 * KERNEL_TAPS

    def arrivals(self, source: Source, head: Pose) -> Arrivals:
        """Return how a source arrives at the head."""
        return self._surroundings.arrivals(source.position, head)

    def place(self, source: Source, head: Pose) -> Place:
        """Return what the arrivals of a source at the head depend on: equal, they are equal."""
        return (
            self._surroundings.changes,
            self.teleports,
            source.teleports,
            source.position.tobytes(),
            head.position.tobytes(),
            head.rotation.tobytes(),
        )

    def paths(self, arrivals: Arrivals) -> tuple[Floats, NDArray[np.float32]]:
        """Return delays ``(K, C)`` in samples and filters ``(K, C, T)`` of all arrivals."""
        shape = (len(arrivals.gains), self._receiver.n_channels)
        delays = np.empty(shape)
        filters = np.empty((*shape, self._receiver.n_taps), np.float32)
        self._receiver.write_paths(
            arrivals.vectors, arrivals.gains, self._sample_rate_hz, delays, filters
        )
        return delays, filters

    def shades(self, arrivals: Arrivals) -> Sections | None:
        """Return the filters ``(K, S, 3)`` of what obstacles leave; None if they take nothing."""
        if arrivals.energies is None:
            return None
        sections: Sections = shelf_filters(arrivals.energies, self._shelves)
        return sections

    def blocks(self, n_paths: int) -> NDArray[np.float32]:
        """Return a buffer ``(2, K, C, block_samples)`` for signals and filters of K paths.

        Sources with equal numbers of paths use the same one, in turns: with a buffer each, those of
        several listeners would not fit into the cache. Filters are zero after their taps.
        """
        if n_paths not in self._blocks:
            shape = (2, n_paths, self._receiver.n_channels, self.mixer.block_samples)
            self._blocks[n_paths] = np.zeros(shape, np.float32)
        return self._blocks[n_paths]


class _Paths:
    """Paths of one source that stay the same paths from step to step.

    Attributes:
        arrivals: Directions, distances and gains at the end of the last step.
        delays: ``(K, C)`` samples at that time.
        reach_samples: How many of the newest samples of the source can be heard in one step.
    """

    def __init__(self, ears: Ears, arrivals: Arrivals) -> None:
        self._ears = ears
        delays, filters = ears.paths(arrivals)
        self._place(arrivals, delays)
        self._blocks = ears.blocks(len(delays))
        self._signals: NDArray[np.float32] = self._blocks[0]
        self._filters: NDArray[np.float32] = self._blocks[1, ..., : filters.shape[-1]]
        self._filters[:] = filters
        self._response = ears.mixer.response(self._blocks[1])
        # the end of the signals of the last step, with which the block of the next one begins
        kept = ears.mixer.block_samples - ears.step_samples
        self._ends: NDArray[np.float32] = np.empty((*delays.shape, kept), np.float32)
        self._shades = ears.shades(arrivals)
        self._states: NDArray[np.float32] = np.zeros((*delays.shape, N_BANDS - 1), np.float32)

    def _place(self, arrivals: Arrivals, delays: Floats) -> None:
        self.arrivals, self.delays = arrivals, delays
        filtered = 0 if arrivals.energies is None else SETTLING_SAMPLES
        self.reach_samples = self._ears.reach_of(float(delays.max())) + filtered

    def begin(self, memory: SignalMemory, n_samples: int, age_samples: int = 0) -> None:
        """Read the whole block at constant delays.

        Args:
            memory: The sound of the source.
            n_samples: How many of its newest samples are heard; earlier ones count as silence.
            age_samples: How many samples before the newest the block ends.
        """
        start = memory.end - min(n_samples, memory.n_samples)
        n_block, constant = self._signals.shape[-1], (self._shades, self._shades)
        if self._shades is not None:
            before = memory.end - age_samples - n_block
            settle(memory.powers, start, before, self.delays, self._shades, self._states)
        self._read(memory, constant, start, self.delays, n_block, age_samples)

    def start(self) -> None:
        """Add sound that was never heard before: without a fade, from its beginning."""
        self._ears.mixer.add(self._signals, self._response, self._response)

    def fade_in(self) -> None:
        """Add the step, beginning with silence."""
        self._ears.mixer.add(self._signals, None, self._response)

    def fade_out(self, memory: SignalMemory) -> None:
        """Add the step at the delays of the last one, ending in silence."""
        constant = self._shades, self._shades
        self._read(memory, constant, 0, self.delays, self._ears.step_samples)
        self._ears.mixer.add(self._signals, self._response, None)

    def stay(self, memory: SignalMemory) -> None:
        """Add the step with the delays and filters of the last one."""
        constant = self._shades, self._shades
        self._read(memory, constant, 0, self.delays, self._ears.step_samples)
        self._ears.mixer.add(self._signals, self._response, self._response)

    def move(
        self,
        memory: SignalMemory,
        arrivals: Arrivals,
        delays: Floats,
        filters: NDArray[np.float32],
    ) -> None:
        """Add the step with delays and filters that change to those given, see `Ears.paths`."""
        shades = self._ears.shades(arrivals)
        before, self._shades = self._shades, shades
        self._read(memory, (before, shades), 0, delays, self._ears.step_samples)
        self._place(arrivals, delays)
        self._filters[:] = filters
        self._ears.mixer.add_changed(self._blocks, self._response)

    def _read(
        self,
        memory: SignalMemory,
        shades: tuple[Sections | None, Sections | None],
        start: int,
        delays: Floats,
        n_samples: int,
        age_samples: int = 0,
    ) -> None:
        """Read new samples; filters change from the first of `shades` to the second."""
        start = max(start, memory.end - memory.n_samples)
        end = memory.end - age_samples
        block = (
            memory.powers, start, end, self.delays, delays, n_samples, self._ends, self._signals,
        )  # fmt: skip
        before, after = shades
        if before is None and after is None:
            read_block(*block)
            return
        nothing = unshaded(len(delays)) if before is None or after is None else before
        sections = nothing if before is None else before, nothing if after is None else after
        read_shaded_block(*block, sections, self._states)


class Propagation:
    """The state of one listener for one source."""

    def __init__(self, source: Source, ears: Ears) -> None:
        self._source = source
        self._ears = ears
        self.reset()

    def reset(self) -> None:
        """Forget the last position of the source and the sound that was read."""
        self._paths: _Paths | None = None
        self._place: Place | None = None
        self._teleports = self._all_teleports
        # the newest samples that were not heard yet: all
        self._unheard_samples = self._ears.reach_samples

    def add_step(self, head: Pose) -> bool:
        """Add the present step to the mixer; return whether anything can be audible."""
        if self._is_silent():
            return False
        place = self._ears.place(self._source, head)
        if self._paths is not None and place == self._place:
            self._paths.stay(self._source.memory)
            return True
        self._place = place
        arrivals = self._ears.arrivals(self._source, head)
        if self._paths is None:
            self._begin(arrivals)
        elif self._all_teleports != self._teleports or not self._follow(self._paths, arrivals):
            self._paths.fade_out(self._source.memory)
            self._paths = _Paths(self._ears, arrivals)
            self._paths.begin(self._source.memory, self._ears.reach_samples)
            self._paths.fade_in()
        self._teleports = self._all_teleports
        return True

    @property
    def _all_teleports(self) -> int:
        """How often source or head were moved at once."""
        return self._source.teleports + self._ears.teleports

    def add_past_step(self, head: Pose, age_samples: int) -> bool:
        """Add a step that was left out, as if nothing had moved since; see `Listener.rejoin`.

        Args:
            head: As in `add_step`.
            age_samples: How many samples before the present the step ended, at least 1.

        Returns:
            Whether anything can be audible.
        """
        self.reset()
        if self._source.silent_samples >= self._ears.reach_samples + age_samples:
            return False
        self._begin(self._ears.arrivals(self._source, head), age_samples)
        return True

    def _is_silent(self) -> bool:
        """Return whether nothing is under way, and drop the paths if so.

        When the sound starts again, its paths start at the position at that time. What was heard
        before must not be heard again there.
        """
        unheard = min(self._unheard_samples + self._ears.step_samples, self._ears.reach_samples)
        silent = self._source.silent_samples
        if self._paths is None:
            self._unheard_samples = unheard
            return silent >= unheard
        if silent < self._paths.reach_samples:
            return False
        self._paths, self._unheard_samples = None, 0
        return True

    def _begin(self, arrivals: Arrivals, age_samples: int = 0) -> None:
        self._paths = _Paths(self._ears, arrivals)
        self._paths.begin(self._source.memory, self._unheard_samples + age_samples, age_samples)
        self._paths.start()

    def _follow(self, paths: _Paths, arrivals: Arrivals) -> bool:
        """Continue with the same paths; return False if these are others or move too fast."""
        if arrivals.same_as(paths.arrivals):
            paths.stay(self._source.memory)
            return True
        if arrivals.paths_id != paths.arrivals.paths_id:
            return False
        delays, filters = self._ears.paths(arrivals)
        if np.abs(delays - paths.delays).max() > self._ears.max_delay_change:
            return False
        paths.move(self._source.memory, arrivals, delays, filters)
        return True


@kernel
def read_block(
    powers: NDArray[np.float32],
    start: int,
    end: int,
    before: Floats,
    after: Floats,
    n_samples: int,
    ends: NDArray[np.float32],
    signals: NDArray[np.float32],
) -> None:
    """Write the blocks of all paths and channels, with `n_samples` new samples each.

    Args:
        powers: See `read_moving`.
        start: Likewise.
        end: Likewise.
        before: ``(K, C)`` delays in samples before the first of the new samples.
        after: ``(K, C)`` delays at the last of them.
        n_samples: B - E, or B.
        ends: ``(K, C, E)`` last samples of the blocks of the last step; overwritten by those of
            these blocks.
        signals: ``(K, C, B)``, overwritten: earlier samples, if there is room, and the new ones.
    """
    kept = signals.shape[2] - n_samples
    for k in range(signals.shape[0]):
        for channel in range(signals.shape[1]):
            signal, last = signals[k, channel], ends[k, channel]
            copy_samples(last, signal[:kept])
            new = signal[kept:]
            read_moving(powers, start, end, before[k, channel], after[k, channel], new)
            copy_samples(signal[signal.shape[0] - last.shape[0] :], last)
