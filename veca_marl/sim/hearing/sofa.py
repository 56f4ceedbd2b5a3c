"""Reader for head-related impulse responses in SOFA files (AES69). Needs ``veca_marl[sofa]``."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

_CONVENTIONS = ("SimpleFreeFieldHRIR", "FreeFieldHRIR")
_FIELDS = ("Data.IR", "Data.SamplingRate", "SourcePosition")
_SAMPLE_RATES_HZ = (8_000.0, 200_000.0)
_LATERAL = 0.5
_FEWEST_DIRECTIONS = 4
_FEWEST_SAMPLES = 16


class SofaError(ValueError):
    """The file does not contain usable head-related impulse responses; the message says why."""


@dataclass(frozen=True)
class MeasuredHead:
    """Measured impulse responses of one head.

    Attributes:
        impulse_responses: ``(M, 2, N)``, left ear first.
        directions: ``(M, 3)`` unit vectors to the loudspeaker in the head frame.
        delays_s: ``(M, 2)`` seconds of delay before the first sample of each response.
        sample_rate_hz: Sampling rate.
        distance_m: Distance of the loudspeaker from the centre of the head.
        source: Name of the file, for messages.
    """

    impulse_responses: Floats
    directions: Floats
    delays_s: Floats
    sample_rate_hz: float
    distance_m: float
    source: str


def read_sofa(path: str | Path, sample_rate_hz: float | None = None) -> MeasuredHead:
    """Read a SOFA file with the impulse responses of two ears.

    The left ear is the receiver with more energy for sources on the left, whatever the file
    states: in files of the LISTEN set the stated receiver positions are swapped.

    Args:
        path: The file.
        sample_rate_hz: Sampling rate to use instead of the file's own; some LISTEN files state
            48 000 although they were measured at 44 100.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If the file does not contain such responses.
    """
    try:
        import h5py
    except ImportError:
        raise ImportError("SOFA files need h5py: pip install 'veca_marl[sofa]'") from None
    name = Path(path).name
    if not Path(path).is_file():
        raise SofaError(f"{path}: no such file")
    try:
        with h5py.File(path, "r") as file:
            _check_convention(file, name)
            fields = {key: np.array(file[key][()], dtype=np.float64) for key in _present(file)}
            kind = _text(file["SourcePosition"].attrs.get("Type", "spherical"))
    except SofaError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise SofaError(f"{name}: cannot be read as SOFA ({error})") from error
    return _measured_head(fields, kind, sample_rate_hz, name)


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _check_convention(file: Any, name: str) -> None:
    attributes = {key: _text(value) for key, value in file.attrs.items()}
    if attributes.get("Conventions") != "SOFA":
        raise SofaError(f"{name}: the attribute Conventions is not SOFA")
    convention = attributes.get("SOFAConventions", "missing")
    if convention not in _CONVENTIONS:
        raise SofaError(f"{name}: SOFAConventions is {convention}, must be one of {_CONVENTIONS}")
    data_type = attributes.get("DataType", "missing")
    if not data_type.startswith("FIR"):
        raise SofaError(f"{name}: DataType is {data_type}, must be FIR")
    missing = [field for field in _FIELDS if field not in file]
    if missing:
        raise SofaError(f"{name}: lacks {', '.join(missing)}")


def _present(file: Any) -> list[str]:
    optional = [key for key in ("Data.Delay", "ReceiverPosition") if key in file]
    return [*_FIELDS, *optional]


def _measured_head(
    fields: dict[str, Floats], kind: str, sample_rate_hz: float | None, name: str
) -> MeasuredHead:
    responses = fields["Data.IR"]
    _check_responses(responses, name)
    directions, distance_m = _directions(fields["SourcePosition"], kind, len(responses), name)
    rate = (
        float(np.ravel(fields["Data.SamplingRate"])[0])
        if sample_rate_hz is None
        else sample_rate_hz
    )
    if not _SAMPLE_RATES_HZ[0] <= rate <= _SAMPLE_RATES_HZ[1]:
        raise SofaError(f"{name}: sampling rate {rate} Hz is outside {_SAMPLE_RATES_HZ}")
    delays = _delays(fields.get("Data.Delay"), len(responses), name) / rate
    if _ears_are_swapped(responses, directions, name):
        responses, delays = responses[:, ::-1], delays[:, ::-1]
        _warn_of_stated_ears(fields.get("ReceiverPosition"), left_row=1, name=name)
    else:
        _warn_of_stated_ears(fields.get("ReceiverPosition"), left_row=0, name=name)
    return MeasuredHead(responses, directions, delays, rate, distance_m, name)


def _check_responses(responses: Floats, name: str) -> None:
    shape = responses.shape
    if len(shape) != 3 or shape[1] != 2 or shape[2] < _FEWEST_SAMPLES:
        raise SofaError(f"{name}: Data.IR has shape {shape}, must be (directions, 2, samples)")
    if shape[0] < _FEWEST_DIRECTIONS:
        raise SofaError(f"{name}: {shape[0]} directions, at least {_FEWEST_DIRECTIONS} are needed")
    if not np.isfinite(responses).all():
        raise SofaError(f"{name}: Data.IR is not finite")
    if not (responses != 0.0).any(axis=-1).all():
        raise SofaError(f"{name}: Data.IR has responses that are all zero")


def _directions(position: Floats, kind: str, count: int, name: str) -> tuple[Floats, float]:
    if position.shape != (count, 3) or not np.isfinite(position).all():
        raise SofaError(f"{name}: SourcePosition has shape {position.shape}, must be ({count}, 3)")
    if not kind.startswith("spherical"):
        distance = np.linalg.norm(position, axis=1)
        if not (distance > 0.0).all():
            raise SofaError(f"{name}: SourcePosition is at the head's centre")
        return position / distance[:, None], float(np.median(distance))
    azimuth, elevation = np.deg2rad(position[:, 0]), np.deg2rad(position[:, 1])
    directions = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=1,
    )
    return directions, float(np.median(position[:, 2]))


def _delays(delay: Floats | None, count: int, name: str) -> Floats:
    if delay is None:
        return np.zeros((count, 2))
    if delay.size not in (2, 2 * count) or not np.isfinite(delay).all():
        raise SofaError(f"{name}: Data.Delay has shape {delay.shape}, must be (1 or {count}, 2)")
    return np.broadcast_to(delay.reshape(-1, 2), (count, 2)).copy()


def _ears_are_swapped(responses: Floats, directions: Floats, name: str) -> bool:
    left, right = directions[:, 1] > _LATERAL, directions[:, 1] < -_LATERAL
    if not left.any() or not right.any():
        raise SofaError(f"{name}: has no directions on one side of the head")
    energy: NDArray[np.float64] = (responses**2).sum(axis=-1)
    louder_left = np.log(energy[left].sum(axis=0)) - np.log(energy[right].sum(axis=0))
    return bool(louder_left[0] < louder_left[1])


def _warn_of_stated_ears(receivers: Floats | None, left_row: int, name: str) -> None:
    if receivers is None or receivers.size < 6:
        return
    stated_left = receivers.reshape(-1, 3)[:2, 1] if receivers.ndim < 3 else receivers[:2, 1, 0]
    if stated_left[left_row] < stated_left[1 - left_row]:
        warnings.warn(
            f"{name}: ReceiverPosition contradicts the data; the left ear is chosen by its energy",
            stacklevel=4,
        )
