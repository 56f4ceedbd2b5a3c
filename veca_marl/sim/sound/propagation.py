"""The way from one source to one listener."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.geometry.pose import Floats, Pose
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
"""What changes its distance faster was put elsewhere: it is cross-faded, not heard as a chirp."""

_NOWHERE: Floats = np.zeros((0, 3))


class Surroundings(Protocol):
    """Where sound travels.

    Attributes:
        spread_m: Upper bound of how much further than the direct sound any image travels.
    """

    spread_m: float

    def arrivals(self, source: Floats, head: Pose) -> tuple[Floats, Floats]:
        """Say from where a source arrives at a head.

        Returns:
            ``(K, 3)`` metres from the head to the source and its images, in the head frame, and
            ``(K,)`` what walls leave of each. K may change from step to step.
        """
        ...


class OneRoom:
    """One room, or the free field without reflections.

    Attributes:
        gains: ``(K,)`` what the walls leave of the direct sound (1) and of each image.
        spread_m: See `Surroundings`.
    """

    def __init__(self, room: Room | None, image_order: int) -> None:
        self.room = room
        self._lattice = image_lattice(image_order if room is not None else 0)
        self._lower = np.zeros(3) if room is None else room.lower
        self._size = np.zeros(3) if room is None else room.size
        self.gains = image_gains(np.ones(6) if room is None else room.beta, self._lattice)
        # an image is at most this far from its source, hence (triangle) the detour no longer
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
    """Lengths that all ways to one listener share.

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
        spatialisation: Receiver,
        surroundings: Surroundings,
        sample_rate_hz: float,
        step_samples: int,
    ) -> StreamFormat:
        """Return the least format in which no filter wraps around (overlap-save)."""
        taps = filter_length(spatialisation, sample_rate_hz, surroundings.spread_m)
        block = scipy.fft.next_fast_len(taps + step_samples - 1, real=True)
        return StreamFormat(sample_rate_hz, step_samples, block)


class Path:
    """What one listener keeps of one source.

    Attributes:
        block: ``(N,)`` float32, the sound delayed by the direct way, newest sample last.
        response_before: ``(C, F)`` spectra of the filters at the end of the last step.
        response: ``(C, F)`` spectra of the filters at the end of this step.
    """

    def __init__(
        self,
        source: Source,
        surroundings: Surroundings,
        spatialisation: Receiver,
        stream: StreamFormat,
    ) -> None:
        self.source = source
        self._surroundings = surroundings
        self._spatialisation = spatialisation
        self._stream = stream
        self.block: NDArray[np.float32] = np.zeros(stream.block_samples, np.float32)
        self._filters = np.zeros((spatialisation.n_channels, stream.block_samples), np.float32)
        self._delayed = np.zeros(stream.step_samples, np.float32)
        self._longest_delay = source.history.size - stream.step_samples - 2 * KERNEL_TAPS
        self._leap = MAX_SPEED_MPS / SPEED_OF_SOUND_MPS * stream.step_samples
        self.reset()

    def reset(self) -> None:
        """Forget all sound and where the source was."""
        self.block[:] = 0.0
        self._quiet_samples = self.block.size
        self._forget_place()

    def _forget_place(self) -> None:
        self._arrivals = self._gains = _NOWHERE
        self._delay = 0.0
        self._jumps = self.source.jumps
        self.response: NDArray[np.complex64] | None = None
        self.response_before: NDArray[np.complex64] | None = None

    @property
    def moved(self) -> bool:
        """Whether this step begins with another filter than it ends with."""
        return self.response_before is not self.response

    def advance(self, head: Pose) -> bool:
        """Take in one step of sound; return whether there is anything to be heard."""
        if not self.source.audible and self._quiet_samples >= self.block.size:
            # a sound that sets in has come from nowhere: it begins where its source is by then
            self._forget_place()
            return False
        self._place(head)
        return True

    def rejoin(self, head: Pose, age_samples: int) -> bool:
        """Recompute the state after steps that were left out.

        The block becomes what it would be if source, head and walls had always been as they are
        now: exact where nothing moved meanwhile.

        Args:
            head: As in `advance`.
            age_samples: How long before the present the block shall end, at least 1.

        Returns:
            Whether there is anything to be heard in the block.
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
        jumped = self._jumps != self.source.jumps or abs(self._delay - before) > self._leap
        self._jumps = self.source.jumps
        self._append(before if known else self._delay, jumped and known)

    def _write_response(self, arrivals: Floats, gains: Floats) -> None:
        stream = self._stream
        self._spatialisation.write_filters(arrivals, gains, stream.sample_rate_hz, self._filters)
        self.response_before = self.response
        self.response = scipy.fft.rfft(self._filters)
        direct = np.sqrt(arrivals[0] @ arrivals[0]) * stream.sample_rate_hz / SPEED_OF_SOUND_MPS
        self._delay = min(float(direct), float(self._longest_delay))
        self._arrivals, self._gains = arrivals, gains

    def _append(self, delay_before: float, jumped: bool) -> None:
        """Append the delayed sound of this step to the block."""
        n = self._stream.step_samples
        self.block[:-n] = self.block[n:]
        new = self.block[-n:]
        if not self.source.audible:
            new[:] = 0.0
            self._quiet_samples += n
            return
        self._quiet_samples = 0
        if not jumped:
            read_delayed(self.source.history, delay_before, self._delay, kernel_bank(), new)
            return
        history, bank, old = self.source.history, kernel_bank(), self._delayed
        read_delayed(history, delay_before, delay_before, bank, old)
        read_delayed(history, self._delay, self._delay, bank, new)
        new += (old - new) * np.linspace(1.0, 0.0, n, dtype=np.float32)
