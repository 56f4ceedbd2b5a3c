"""Propagation of sound from one source to one listener."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.sound.acoustics import (
    SPEED_OF_SOUND_MPS,
    Room,
    image_gains,
    image_lattice,
    image_sources,
)
from veca_marl.sim.sound.fractional_delay import KERNEL_TAPS, kernel_bank, read_delayed
from veca_marl.sim.sound.receiver import Receiver, filter_length
from veca_marl.sim.sound.sound_source import Source

MAX_SPEED_MPS = 50.0
"""A source whose distance changes faster counts as teleported: cross-faded, without a chirp."""

_NO_ARRIVALS: Floats = np.zeros((0, 3))


class Surroundings(Protocol):
    """The rooms that sound propagates in.

    Attributes:
        spread_m: Upper bound of the additional path length of any image beyond the direct sound.
    """

    spread_m: float

    def arrivals(self, source: Floats, head: Pose) -> tuple[Floats, Floats]:
        """Return the directions, distances and gains with which a source arrives at a head.

        Returns:
            ``(K, 3)`` metres from the head to the source and its images, in the head frame, and
            ``(K,)`` pressure gains by walls. K may change from step to step.
        """
        ...


class OneRoom:
    """One room, or the free field without reflections.

    Attributes:
        gains: ``(K,)`` pressure gains by the walls: 1 for the direct sound, then of each image.
        spread_m: See `Surroundings`.
    """

    def __init__(self, room: Room | None, image_order: int) -> None:
        self.room = room
        self._lattice = image_lattice(image_order if room is not None else 0)
        self._lower = np.zeros(3) if room is None else room.lower
        self._size = np.zeros(3) if room is None else room.size
        self.gains = image_gains(np.ones(6) if room is None else room.beta, self._lattice)
        # the distance of an image from its source bounds the detour (triangle inequality)
        detours = 2 * ((np.abs(self._lattice) + 1) // 2) * self._size
        self.spread_m = float(np.linalg.norm(detours, axis=1).max())

    def arrivals(self, source: Floats, head: Pose) -> tuple[Floats, Floats]:
        """See `Surroundings`."""
        position = head.position
        if self.room is not None:
            source, position = self.room.clamp(source), self.room.clamp(position)
        images = image_sources(source, self._lower, self._size, self._lattice)
        vectors: Floats = (images - position) @ head.rotation
        return vectors, self.gains


@dataclass(frozen=True)
class StreamFormat:
    """Lengths that all paths to one listener share.

    Attributes:
        sample_rate_hz: Sampling rate.
        step_samples: Samples per control step.
        block_samples: Length of the block that is filtered at once.
    """

    sample_rate_hz: float
    step_samples: int
    block_samples: int

    @staticmethod
    def for_listener(
        receiver: Receiver,
        surroundings: Surroundings,
        sample_rate_hz: float,
        step_samples: int,
    ) -> StreamFormat:
        """Return the shortest block in which no filter wraps around (overlap-save)."""
        taps = filter_length(receiver, sample_rate_hz, surroundings.spread_m)
        block = scipy.fft.next_fast_len(taps + step_samples - 1, real=True)
        return StreamFormat(sample_rate_hz, step_samples, block)


class Path:
    """The state of one listener for one source.

    Attributes:
        block: ``(N,)`` float32, the sound delayed by the direct path, newest sample last.
        response_before: ``(C, F)`` spectra of the filters at the end of the last step.
        response: ``(C, F)`` spectra of the filters at the end of this step.
    """

    def __init__(
        self,
        source: Source,
        surroundings: Surroundings,
        receiver: Receiver,
        stream: StreamFormat,
    ) -> None:
        self.source = source
        self._surroundings = surroundings
        self._receiver = receiver
        self._stream = stream
        self.block: NDArray[np.float32] = np.zeros(stream.block_samples, np.float32)
        self._filters = np.zeros((receiver.n_channels, stream.block_samples), np.float32)
        self._delayed = np.zeros(stream.step_samples, np.float32)
        self._longest_delay = source.history.size - stream.step_samples - 2 * KERNEL_TAPS
        self._max_delay_change = MAX_SPEED_MPS / SPEED_OF_SOUND_MPS * stream.step_samples
        self.reset()

    def reset(self) -> None:
        """Clear the sound and the last position of the source."""
        self.block[:] = 0.0
        self._quiet_samples = self.block.size
        self._clear_position()

    def _clear_position(self) -> None:
        self._arrivals = self._gains = _NO_ARRIVALS
        self._delay = 0.0
        self._teleports = self.source.teleports
        self.response: NDArray[np.complex64] | None = None
        self.response_before: NDArray[np.complex64] | None = None

    @property
    def moved(self) -> bool:
        """Whether the filters at the beginning and at the end of this step differ."""
        return self.response_before is not self.response

    def advance(self, head: Pose) -> bool:
        """Take in one step of sound; return whether anything is audible."""
        if not self.source.audible and self._quiet_samples >= self.block.size:
            # when the sound starts again, its path starts at the position at that time
            self._clear_position()
            return False
        self._place(head)
        return True

    def rejoin(self, head: Pose, age_samples: int) -> bool:
        """Recompute the state after steps that were left out.

        The block becomes what it would be if source, head and obstacles had always been where
        they are now: exact where nothing moved meanwhile.

        Args:
            head: As in `advance`.
            age_samples: How many samples before the present the block ends, at least 1.

        Returns:
            Whether anything is audible in the block.
        """
        self.reset()
        past = self.source.past(age_samples)
        if not past.any():
            return False
        self._write_response(*self._surroundings.arrivals(self.source.position, head))
        self.response_before = self.response
        read_delayed(past, self._delay, self._delay, kernel_bank(), self.block)
        heard = np.flatnonzero(self.block)
        if heard.size:
            self._quiet_samples = self.block.size - 1 - int(heard[-1])
        return bool(heard.size)

    def _place(self, head: Pose) -> None:
        arrivals, gains = self._surroundings.arrivals(self.source.position, head)
        before = self._delay
        if not (np.array_equal(arrivals, self._arrivals) and np.array_equal(gains, self._gains)):
            self._write_response(arrivals, gains)
        else:
            self.response_before = self.response
        known = self.response_before is not None
        if not known:
            self.response_before = self.response
        is_teleported = (
            self._teleports != self.source.teleports
            or abs(self._delay - before) > self._max_delay_change
        )
        self._teleports = self.source.teleports
        self._append(before if known else self._delay, is_teleported and known)

    def _write_response(self, arrivals: Floats, gains: Floats) -> None:
        stream = self._stream
        self._receiver.write_filters(arrivals, gains, stream.sample_rate_hz, self._filters)
        self.response_before = self.response
        self.response = scipy.fft.rfft(self._filters)
        direct = np.sqrt(arrivals[0] @ arrivals[0]) * stream.sample_rate_hz / SPEED_OF_SOUND_MPS
        self._delay = min(float(direct), float(self._longest_delay))
        self._arrivals, self._gains = arrivals, gains

    def _append(self, delay_before: float, is_teleported: bool) -> None:
        """Append the delayed sound of this step to the block."""
        n = self._stream.step_samples
        self.block[:-n] = self.block[n:]
        new = self.block[-n:]
        if not self.source.audible:
            new[:] = 0.0
            self._quiet_samples += n
            return
        self._quiet_samples = 0
        if not is_teleported:
            read_delayed(self.source.history, delay_before, self._delay, kernel_bank(), new)
            return
        history, bank, old = self.source.history, kernel_bank(), self._delayed
        read_delayed(history, delay_before, delay_before, bank, old)
        read_delayed(history, self._delay, self._delay, bank, new)
        new += (old - new) * np.linspace(1.0, 0.0, n, dtype=np.float32)
