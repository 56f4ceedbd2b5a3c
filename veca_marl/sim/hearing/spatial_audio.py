"""Binaural rendering of a static scene: the paper's `getSpatialAudio`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing.hrtf import HrtfTable, kemar_table
from veca_marl.sim.hearing.receivers import HrtfReceiver
from veca_marl.sim.sound import Clip, Room, SoundField


def get_spatial_audio(
    head: Pose,
    ear_left: ArrayLike,
    ear_right: ArrayLike,
    sources: Sequence[tuple[ArrayLike, ArrayLike]],
    room_size: ArrayLike | None = None,
    beta: float | Sequence[float] = 0.5,
    image_order: int = 6,
    table: HrtfTable | None = None,
) -> NDArray[np.float32]:
    """Render static sources for two ears of a head (the paper's appendix: `getSpatialAudio`).

    It uses the sound field of the agents' hearing, without its constant latency.

    Args:
        head: Position and rotation of the head.
        ear_left: ``(3,)`` metres, world frame. The head-related response is centred between the
            ears and has the rotation of the head.
        ear_right: ``(3,)`` metres, world frame.
        sources: Waveforms ``(n,)`` (rms pressure at 1 m) with their positions ``(3,)`` in metres.
            All begin at sample 0 after silence.
        room_size: ``(3,)`` metres of a room with a corner at the origin and positive coordinates;
            None is the free field.
        beta: Pressure reflection coefficient of the walls, one or six, see `Room`.
        image_order: Greatest number of reflections, with a room.
        table: The head-related transfer functions; None is KEMAR. Their sampling rate is that of
            the waveforms.

    Returns:
        ``(2, n)`` float32, left ear first, with the length of the longest waveform.

    Raises:
        ValueError: If the room is invalid, or the head, an ear or a source is outside of it.
    """
    table = kemar_table() if table is None else table
    ears = np.stack([_point("ear_left", ear_left), _point("ear_right", ear_right)])
    room = None if room_size is None else Room(np.zeros(3), room_size, beta)
    clips = [Clip(waveform) for waveform, _ in sources]
    positions = [_point(f"source {i}", position) for i, (_, position) in enumerate(sources)]
    if room is not None:
        _check_inside(room, [head.position, *ears], "the head with its ears")
        _check_inside(room, positions, "every source")
    field = _field(room, image_order, table.sample_rate_hz, positions, ears)
    for i, (clip, position) in enumerate(zip(clips, positions, strict=True)):
        field.add_source(str(i), clip).position = position
    listener = field.add_listener(HrtfReceiver(table))
    n_samples = max((clip.waveform.size for clip in clips), default=0)
    centre = Pose(ears.mean(axis=0), head.rotation)
    steps = [np.zeros((2, 0), np.float32)]
    for _ in range(math.ceil((n_samples + field.latency_samples) / field.step_samples)):
        field.advance()
        steps.append(listener.render(centre))
    heard = np.concatenate(steps, axis=1)
    return heard[:, field.latency_samples : field.latency_samples + n_samples]


def _field(
    room: Room | None, image_order: int, sample_rate_hz: int, sources: list[Floats], ears: Floats
) -> SoundField:
    """Return a field in which all sources are heard, whatever their distance."""
    distances = [float(np.linalg.norm(source - ears.mean(axis=0))) for source in sources]
    return SoundField(
        room,
        sample_rate_hz=sample_rate_hz,
        image_order=image_order,
        reach_m=max([1.0, *distances]),
    )


def _point(name: str, value: ArrayLike) -> Floats:
    point = np.asarray(value, dtype=np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ValueError(f"{name}: a position must be (3,) finite metres, got {value!r}")
    return point


def _check_inside(room: Room, positions: Sequence[Floats], what: str) -> None:
    for position in positions:
        if not room.contains(position):
            raise ValueError(
                f"{what} must be inside the room, from {room.lower} to {room.lower + room.size} m; "
                f"got {position}"
            )
