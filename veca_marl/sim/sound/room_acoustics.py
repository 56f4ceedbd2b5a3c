"""Room acoustics as pure functions: image sources, impulse responses, decay times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled

SPEED_OF_SOUND_MPS = 343.0
"""Dry air at 20 degrees Celsius (ISO 9613-1)."""

NEAR_FIELD_M = 0.107
"""Distance below which the gain is constant, that of the mouth from the ears of the bodies."""

_WALL_MARGIN_M = 0.01
_DECAY = 24.0 * math.log(10.0) / SPEED_OF_SOUND_MPS


class Room:
    """A rectangular room that reflects sound, in playground coordinates.

    Attributes:
        lower: ``(3,)`` metres, the corner with the least coordinates.
        size: ``(3,)`` metres.
        beta: ``(6,)`` pressure reflection coefficients of the walls in [0, 1], in the order
            x low, x high, y low, y high, z low (floor), z high (ceiling).
    """

    def __init__(
        self, lower: ArrayLike, size: ArrayLike, beta: float | Sequence[float] = 0.5
    ) -> None:
        self.lower = _triple("lower", lower)
        self.size = _triple("size", size)
        if not (self.size > 0.0).all():
            raise ValueError(f"room size must be positive in every direction, got {size!r}")
        coefficients = np.asarray(beta, dtype=np.float64)
        if coefficients.shape not in ((), (6,)):
            raise ValueError(f"beta must be one number or six, got shape {coefficients.shape}")
        if not ((coefficients >= 0.0) & (coefficients <= 1.0)).all():
            raise ValueError(f"beta must lie in [0, 1], got {beta}")
        self.beta: Floats = np.broadcast_to(coefficients, (6,)).copy()

    def contains(self, position: ArrayLike) -> bool:
        """Whether a point ``(3,)`` lies in the room, walls included."""
        offset = np.asarray(position, dtype=np.float64) - self.lower
        return bool(((offset >= 0.0) & (offset <= self.size)).all())

    def clamp(self, position: Floats) -> Floats:
        """Return the point ``(3,)`` if it is inside, else the nearest one 1 cm inside the walls."""
        lowest, highest = self.bounds()
        nearest: Floats = np.minimum(np.maximum(position, lowest), highest)
        return nearest

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinates ``(3,)`` of sources and heads inside."""
        margin = np.minimum(_WALL_MARGIN_M, 0.25 * self.size)
        return self.lower + margin, self.lower + self.size - margin


def _triple(name: str, value: ArrayLike) -> Floats:
    triple = np.array(value, dtype=np.float64)
    if triple.shape != (3,) or not np.isfinite(triple).all():
        raise ValueError(f"room {name} must be three finite numbers, got {value!r}")
    return triple


@cache
def image_lattice(order: int) -> NDArray[np.int64]:
    """Return the reflection indices of all image sources up to an order, direct sound first.

    Allen & Berkley (1979), section II: index n along an axis means ``|n|`` reflections on that
    axis's two walls.

    Args:
        order: Greatest number of reflections, 0 for the direct sound alone.

    Returns:
        ``(K, 3)`` with ``|nx| + |ny| + |nz| <= order``; K = 1, 7, 25, 63 for orders 0 to 3.
        Read-only.
    """
    if order < 0:
        raise ValueError(f"image order must not be negative, got {order}")
    axis = np.arange(-order, order + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    reflections = np.abs(grid).sum(axis=1)
    lattice = grid[np.argsort(reflections, kind="stable")][: int((reflections <= order).sum())]
    lattice.setflags(write=False)
    return lattice


@compiled
def image_sources(
    source: Floats, lower: Floats, size: Floats, lattice: NDArray[np.int64]
) -> Floats:
    """Mirror a source in the walls of a room (Allen & Berkley 1979, eq. 6).

    Args:
        source: ``(3,)`` metres.
        lower: ``(3,)`` metres, the room's lower corner.
        size: ``(3,)`` metres.
        lattice: ``(K, 3)`` from `image_lattice`.

    Returns:
        ``(K, 3)`` metres.
    """
    images = np.empty(lattice.shape)
    for k in range(lattice.shape[0]):
        for axis in range(3):
            n = lattice[k, axis]
            inside = source[axis] - lower[axis]
            mirrored = inside if n % 2 == 0 else size[axis] - inside
            images[k, axis] = lower[axis] + n * size[axis] + mirrored
    return images


def image_gains(beta: Floats, lattice: NDArray[np.int64]) -> Floats:
    """Return the pressure gain of each image source by the walls (Allen & Berkley 1979, eq. 10).

    Args:
        beta: ``(6,)`` pressure reflection coefficients, see `Room`.
        lattice: ``(K, 3)`` from `image_lattice`.

    Returns:
        ``(K,)`` product of the coefficients of all walls that reflected the sound.
    """
    count = np.abs(lattice)
    more, less = (count + 1) // 2, count // 2
    low = np.where(lattice > 0, less, more)
    high = np.where(lattice > 0, more, less)
    gains: Floats = np.prod(beta[0::2] ** low * beta[1::2] ** high, axis=1)
    return gains


def distance_gain(distance_m: ArrayLike) -> Floats:
    """Return the pressure relative to that at 1 m: 1/d, constant below `NEAR_FIELD_M`."""
    gain: Floats = 1.0 / np.maximum(np.asarray(distance_m, dtype=np.float64), NEAR_FIELD_M)
    return gain


def room_impulse_response(
    source: ArrayLike,
    receiver: ArrayLike,
    room: Room,
    order: int,
    sample_rate_hz: float,
    n_samples: int,
    n_taps: int = 81,
) -> Floats:
    """Return the impulse response from a source to an omnidirectional receiver.

    The sum over all images (Allen & Berkley 1979, eq. 8) with the band-limited impulses of Peterson
    (1986). Independent of the streaming implementation, which is tested against it.

    Args:
        source: ``(3,)`` metres.
        receiver: ``(3,)`` metres.
        room: The room both are in.
        order: Greatest number of reflections.
        sample_rate_hz: Sampling rate.
        n_samples: Length of the response; later reflections are left out.
        n_taps: Width of one band-limited impulse (odd).

    Returns:
        ``(n_samples,)`` float64; sample k is time ``k / sample_rate_hz`` after the emission.
    """
    lattice = image_lattice(order)
    images = image_sources(np.asarray(source, dtype=np.float64), room.lower, room.size, lattice)
    distance = np.linalg.norm(images - np.asarray(receiver, dtype=np.float64), axis=1)
    arrival = distance * sample_rate_hz / SPEED_OF_SOUND_MPS
    gains = image_gains(room.beta, lattice) * distance_gain(distance)
    used = (arrival < n_samples) & (gains != 0.0)
    response = np.zeros(n_samples + 2 * n_taps)
    for batch in np.array_split(np.flatnonzero(used), 1 + int(used.sum()) // 100_000):
        _add_impulses(response, arrival[batch] + n_taps, gains[batch], n_taps)
    return response[n_taps : n_taps + n_samples]


def _add_impulses(response: Floats, arrival: Floats, gains: Floats, n_taps: int) -> None:
    half = n_taps // 2
    whole = np.rint(arrival).astype(np.int64)
    offset = np.arange(-half, half + 1) - (arrival - whole)[:, None]
    window = 0.5 + 0.5 * np.cos(np.pi * np.clip(offset / (half + 0.5), -1.0, 1.0))
    index = whole[:, None] + np.arange(-half, half + 1)
    np.add.at(response, index, np.sinc(offset) * window * gains[:, None])


def sabine_decay_time(size: ArrayLike, beta: float) -> float:
    """Return the time in s in which sound decays by 60 dB (Sabine; Kuttruff 2016, eq. 5.25).

    Args:
        size: ``(3,)`` metres.
        beta: Pressure reflection coefficient of all walls, in (0, 1).
    """
    volume, surface = _volume_and_surface(size)
    return _DECAY * volume / (surface * (1.0 - beta**2))


def eyring_decay_time(size: ArrayLike, beta: float) -> float:
    """Return the time in s in which sound decays by 60 dB (Eyring; Kuttruff 2016, eq. 5.24)."""
    volume, surface = _volume_and_surface(size)
    return _DECAY * volume / (-surface * math.log(beta**2))


def _volume_and_surface(size: ArrayLike) -> tuple[float, float]:
    x, y, z = np.asarray(size, dtype=np.float64)
    return float(x * y * z), float(2.0 * (x * y + y * z + z * x))
