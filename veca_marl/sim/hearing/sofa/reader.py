"""Head-related impulse responses from a SOFA file: what is accepted, and which ear is left."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.sofa.fields import SofaFile, open_sofa
from veca_marl.sim.hearing.sofa.measured_head import MeasuredHead, SofaError
from veca_marl.sim.hearing.sofa.positions import far_field, source_vectors

_CONVENTIONS = ("SimpleFreeFieldHRIR", "FreeFieldHRIR")
_FIELDS = ("Data.IR", "Data.SamplingRate", "SourcePosition")
_SAMPLE_RATES_HZ = (8_000.0, 200_000.0)
_LATERAL = 0.5
_FEWEST_DIRECTIONS = 4
_FEWEST_SAMPLES, _MOST_SAMPLES = 16, 1 << 16
_LARGEST_GAP_DEG = 40.0


def read_sofa(path: str | Path, sample_rate_hz: float | None = None) -> MeasuredHead:
    """Read a SOFA file with the impulse responses of two ears.

    The left ear is the receiver with more energy for sources on the left, whatever the file
    states: in files of the LISTEN set the stated receiver positions are swapped. Of a set with
    several distances the longest is used. Sizes and types are checked before anything is
    allocated, and no other file is opened.

    Args:
        path: The file.
        sample_rate_hz: Sampling rate to use instead of the file's own; some LISTEN files state
            48 000 although they were measured at 44 100.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If the file does not contain such responses, or none within 40 degrees of some
            direction above the horizontal plane (sets of the horizontal plane or of the frontal
            half alone).
    """
    with open_sofa(path) as file:
        return _measured_head(file, sample_rate_hz, Path(path).name)


def _measured_head(file: SofaFile, sample_rate_hz: float | None, name: str) -> MeasuredHead:
    _check_convention(file, name)
    shape = file.shape("Data.IR")
    _check_shape(shape, name)
    used, directions, distance_m = far_field(source_vectors(file, shape[0], name), name)
    _check_coverage(directions, name)
    rate = _sample_rate(file, name) if sample_rate_hz is None else sample_rate_hz
    if not _SAMPLE_RATES_HZ[0] <= rate <= _SAMPLE_RATES_HZ[1]:
        raise SofaError(f"{name}: sampling rate {rate} Hz is outside {_SAMPLE_RATES_HZ}")
    delays = _delays(file, shape[0], name)[used] / rate
    responses = _responses(file, name)[used]
    swapped = _ears_are_swapped(responses, directions, name)
    if swapped:
        responses, delays = responses[:, ::-1], delays[:, ::-1]
    _warn_of_stated_ears(file, int(swapped), name)
    return MeasuredHead(responses, directions, delays, rate, distance_m, name)


def _check_convention(file: SofaFile, name: str) -> None:
    if file.attribute("Conventions") != "SOFA":
        raise SofaError(f"{name}: the attribute Conventions is not SOFA")
    convention = file.attribute("SOFAConventions") or "missing"
    if convention not in _CONVENTIONS:
        raise SofaError(f"{name}: SOFAConventions is {convention}, must be one of {_CONVENTIONS}")
    data_type = file.attribute("DataType") or "missing"
    if data_type != "FIR":
        raise SofaError(f"{name}: DataType is {data_type}, must be FIR")
    missing = [field for field in _FIELDS if field not in file]
    if missing:
        raise SofaError(f"{name}: lacks {', '.join(missing)}")


def _check_shape(shape: tuple[int, ...], name: str) -> None:
    if len(shape) != 3 or shape[1] != 2 or not _FEWEST_SAMPLES <= shape[2] <= _MOST_SAMPLES:
        raise SofaError(
            f"{name}: Data.IR has shape {shape}, must be (directions, 2, samples) with "
            f"{_FEWEST_SAMPLES} to {_MOST_SAMPLES} samples"
        )
    if shape[0] < _FEWEST_DIRECTIONS:
        raise SofaError(f"{name}: {shape[0]} directions, at least {_FEWEST_DIRECTIONS} are needed")


def _check_coverage(directions: Floats, name: str) -> None:
    """Raise `SofaError` where some direction above the horizontal plane is far from all."""
    if not (directions[:, 1] > _LATERAL).any() or not (directions[:, 1] < -_LATERAL).any():
        raise SofaError(f"{name}: has no directions on one side of the head (are its Units right?)")
    elevation, azimuth = np.deg2rad([(e, a) for e in range(0, 91, 10) for a in range(0, 360, 10)]).T
    upper = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=1,
    )
    gap_deg = np.rad2deg(2.0 * np.arcsin(cKDTree(directions).query(upper)[0] / 2.0))
    worst = int(gap_deg.argmax())
    if gap_deg[worst] > _LARGEST_GAP_DEG:
        raise SofaError(
            f"{name}: the measured direction nearest to azimuth "
            f"{np.rad2deg(azimuth[worst]):.0f}, elevation {np.rad2deg(elevation[worst]):.0f} is "
            f"{gap_deg[worst]:.0f} degrees away, at most {_LARGEST_GAP_DEG:.0f} can be interpolated"
        )


def _sample_rate(file: SofaFile, name: str) -> float:
    if file.shape("Data.SamplingRate") not in ((), (1,), (1, 1), file.shape("Data.IR")[:1]):
        raise SofaError(f"{name}: Data.SamplingRate has shape {file.shape('Data.SamplingRate')}")
    rates = file.read("Data.SamplingRate")
    if rates.units not in ("", "hertz", "hz"):
        raise SofaError(f"{name}: Data.SamplingRate is in {rates.units!r}, must be 'hertz'")
    if not np.isfinite(rates.values).all() or np.ptp(rates.values) > 0.0:
        raise SofaError(f"{name}: Data.SamplingRate is not one finite number")
    return float(np.ravel(rates.values)[0])


def _delays(file: SofaFile, count: int, name: str) -> Floats:
    """Return the delays ``(count, 2)`` in samples, zero if the file states none."""
    if "Data.Delay" not in file:
        return np.zeros((count, 2))
    if file.shape("Data.Delay") not in ((2,), (1, 2), (count, 2)):
        raise SofaError(
            f"{name}: Data.Delay has shape {file.shape('Data.Delay')}, must be (1 or {count}, 2)"
        )
    delays = file.read("Data.Delay").values
    if not np.isfinite(delays).all():
        raise SofaError(f"{name}: Data.Delay is not finite")
    return np.broadcast_to(delays.reshape(-1, 2), (count, 2))


def _responses(file: SofaFile, name: str) -> Floats:
    responses = file.read("Data.IR").values
    if not np.isfinite(responses).all():
        raise SofaError(f"{name}: Data.IR is not finite")
    if not (responses != 0.0).any(axis=-1).all():
        raise SofaError(f"{name}: Data.IR has responses that are all zero")
    return responses


def _ears_are_swapped(responses: Floats, directions: Floats, name: str) -> bool:
    left, right = directions[:, 1] > _LATERAL, directions[:, 1] < -_LATERAL
    energy: NDArray[np.float64] = (responses**2).sum(axis=-1)
    louder_left = np.log(energy[left].sum(axis=0)) - np.log(energy[right].sum(axis=0))
    return bool(louder_left[0] < louder_left[1])


def _warn_of_stated_ears(file: SofaFile, left_row: int, name: str) -> None:
    """Warn if cartesian receiver positions put the left ear on the right."""
    if "ReceiverPosition" not in file or file.shape("ReceiverPosition")[:2] != (2, 3):
        return
    stated = file.read("ReceiverPosition")
    stated_left = stated.values.reshape(2, 3, -1)[:, 1, 0]
    if stated.kind != "spherical" and stated_left[left_row] < stated_left[1 - left_row]:
        warnings.warn(
            f"{name}: ReceiverPosition contradicts the data; the left ear is chosen by its energy",
            stacklevel=4,
        )
