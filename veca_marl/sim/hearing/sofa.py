"""Reader for head-related impulse responses in SOFA files (AES69). Needs ``veca_marl[sofa]``.

Each field of a file is checked before anything is allocated.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import Floats

MOST_VALUES = 1 << 26
"""Largest number of values of one field, 512 MiB of float64, four times the largest known set."""

# deflate, the compression of netCDF, reaches at most 1032 to 1
_STRONGEST_COMPRESSION = 1100
# small fields of which nothing is stored hold the default value of their variable
_NEVER_WRITTEN_BYTES = 1 << 16
_LONGEST_ATTRIBUTE = 1 << 16

_METRES = ("metre", "metres", "meter", "meters", "m")
_ANGLES = {"degree": np.pi / 180.0, "degrees": np.pi / 180.0, "radian": 1.0, "radians": 1.0}
# a set with several distances: those beyond this share of the longest are kept
_SAME_DISTANCE = 0.95
# a loudspeaker closer than that touches the head
_NEAREST_M = 0.2

_CONVENTIONS = ("SimpleFreeFieldHRIR", "FreeFieldHRIR")
_FIELDS = ("Data.IR", "Data.SamplingRate", "SourcePosition")
_SAMPLE_RATES_HZ = (8_000.0, 200_000.0)
_LATERAL = 0.5
_FEWEST_DIRECTIONS = 4
_FEWEST_SAMPLES, _MOST_SAMPLES = 16, 1 << 16
_LARGEST_GAP_DEG = 40.0


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


@dataclass(frozen=True)
class Field:
    """One numeric field.

    Attributes:
        values: Its values.
        kind: Its attribute Type (``cartesian`` or ``spherical``), empty if absent.
        units: Its attribute Units in lower case, empty if absent.
    """

    values: Floats
    kind: str
    units: str


class SofaFile:
    """An open SOFA file."""

    def __init__(self, file: Any, name: str) -> None:
        self._file = file
        self._name = name

    def attribute(self, key: str) -> str:
        """Return a global attribute, empty if it is absent."""
        return self._attribute(self._file, key)

    def __contains__(self, key: str) -> bool:
        """Whether the file has an object of this name."""
        return self._file.get(key, getlink=True, default=None) is not None

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the declared shape of a field.

        Raises:
            SofaError: If the field is absent, not numeric, stored in another file, or larger than
                `MOST_VALUES` or than its stored bytes can hold.
        """
        return tuple(self._dataset(key).shape)

    def read(self, key: str) -> Field:
        """Return a field as float64; see `shape` for what is refused before."""
        dataset = self._dataset(key)
        values = np.array(dataset[()], dtype=np.float64)
        kind = self._attribute(dataset, "Type").lower()
        return Field(values, kind, self._attribute(dataset, "Units").lower())

    def _dataset(self, key: str) -> Any:
        import h5py

        link = self._file.get(key, getlink=True, default=None)
        if link is None:
            raise SofaError(f"{self._name}: lacks {key}")
        if not isinstance(link, h5py.HardLink):
            raise SofaError(f"{self._name}: {key} is a link to another place, which is refused")
        dataset = self._file[key]
        if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu":
            raise SofaError(f"{self._name}: {key} is not an array of numbers")
        if dataset.external or dataset.is_virtual:
            raise SofaError(f"{self._name}: {key} is stored in another file, which is refused")
        self._check_size(key, dataset)
        return dataset

    def _check_size(self, key: str, dataset: Any) -> None:
        # Python integers: the product of declared sizes may exceed 64 bits
        count = math.prod(int(size) for size in dataset.shape)
        if count > MOST_VALUES:
            raise SofaError(
                f"{self._name}: {key} declares {count} values, at most {MOST_VALUES} are read"
            )
        if math.prod(dataset.chunks or (1,)) > MOST_VALUES:
            raise SofaError(f"{self._name}: {key} is stored in chunks of shape {dataset.chunks}")
        stored = dataset.id.get_storage_size()
        if count * dataset.dtype.itemsize > _STRONGEST_COMPRESSION * stored + _NEVER_WRITTEN_BYTES:
            raise SofaError(
                f"{self._name}: {key} declares {count} values but only {stored} bytes are stored"
            )

    def _attribute(self, owner: Any, key: str) -> str:
        if key not in owner.attrs:
            return ""
        stored = owner.attrs.get_id(key)
        if math.prod(stored.shape or (1,)) != 1 or stored.dtype.itemsize > _LONGEST_ATTRIBUTE:
            raise SofaError(f"{self._name}: the attribute {key} is not a short text")
        value = np.ravel(owner.attrs[key])[0]
        return (value.decode(errors="replace") if isinstance(value, bytes) else str(value)).strip()


@contextmanager
def open_sofa(path: str | Path) -> Iterator[SofaFile]:
    """Open a SOFA file.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If it does not exist or cannot be read, also while its fields are read.
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
            yield SofaFile(file, name)
    except SofaError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise SofaError(f"{name}: cannot be read as SOFA ({error})") from error


def source_vectors(file: SofaFile, count: int, name: str) -> Floats:
    """Return where the loudspeaker was, ``(count, 3)`` metres in the frame of the head.

    Positions in a SOFA file are those of a room; ListenerPosition, ListenerView and ListenerUp
    state where the head was in it and where it faced.

    Raises:
        SofaError: If a position is missing, of unknown type or units, or not finite.
    """
    to_source = _vectors(file, "SourcePosition", count, name)
    if "ListenerPosition" in file:
        to_source = to_source - _vectors(file, "ListenerPosition", count, name)
    if "ListenerView" not in file:
        return to_source
    view_kind = file.read("ListenerView")
    forward = _unit(_vectors(file, "ListenerView", count, name), name)
    up = np.tile((0.0, 0.0, 1.0), (count, 1))
    if "ListenerUp" in file:
        # AES69 gives ListenerUp the type and units of ListenerView
        stated = file.read("ListenerUp")
        frame = Field(stated.values, stated.kind or view_kind.kind, stated.units or view_kind.units)
        up = _converted(frame, "ListenerUp", count, name)
    left = _unit(np.cross(up, forward), name)
    axes = np.stack([forward, left, np.cross(forward, left)], axis=1)
    in_head: Floats = np.einsum("mij,mj->mi", axes, to_source)
    return in_head


def far_field(vectors: Floats, name: str) -> tuple[NDArray[np.int64], Floats, float]:
    """Select the measurements at the longest distance, and one of each direction.

    Args:
        vectors: ``(M, 3)`` metres, see `source_vectors`.
        name: Of the file.

    Returns:
        Indices ``(K,)`` of the selected measurements, their unit vectors ``(K, 3)`` and their
        distance in metres.

    Raises:
        SofaError: If the longest distance is less than 0.2 m.
    """
    distance = np.linalg.norm(vectors, axis=1)
    if not distance.max() >= _NEAREST_M:
        raise SofaError(
            f"{name}: the longest distance of a source is {distance.max():.2f} m, must be at least "
            f"{_NEAREST_M} m from the centre of the head"
        )
    far = np.flatnonzero(distance >= _SAME_DISTANCE * distance.max())
    if far.size < distance.size:
        warnings.warn(
            f"{name}: of {distance.size} measurements the {far.size} at the longest distance, "
            f"{distance.max():.2f} m, are used",
            stacklevel=4,
        )
    directions = vectors[far] / distance[far, None]
    first = np.sort(np.unique(np.round(directions, 6), axis=0, return_index=True)[1])
    return far[first], directions[first], float(np.median(distance[far]))


def _vectors(file: SofaFile, key: str, count: int, name: str) -> Floats:
    if file.shape(key) not in ((count, 3), (1, 3)):
        raise SofaError(
            f"{name}: {key} has shape {file.shape(key)}, must be ({count}, 3) or (1, 3)"
        )
    return _converted(file.read(key), key, count, name)


def _converted(field: Field, key: str, count: int, name: str) -> Floats:
    """Return cartesian metres ``(count, 3)``."""
    if not np.isfinite(field.values).all():
        raise SofaError(f"{name}: {key} is not finite")
    values = np.broadcast_to(field.values, (count, 3))
    units = [unit.strip() for unit in field.units.replace(",", " ").split()]
    if field.kind == "cartesian" and units and set(units) <= set(_METRES):
        return values
    if field.kind == "spherical" and len(units) == 3 and units[2] in _METRES:
        angles = [_ANGLES.get(unit) for unit in units[:2]]
        if angles[0] is not None and angles[1] is not None:
            return _from_spherical(values * (angles[0], angles[1], 1.0), key, name)
    raise SofaError(
        f"{name}: {key} has Type {field.kind!r} and Units {field.units!r}, must be 'cartesian' in "
        "'metre' or 'spherical' in 'degree, degree, metre' or 'radian, radian, metre'"
    )


def _from_spherical(values: Floats, key: str, name: str) -> Floats:
    azimuth, elevation, distance = values.T
    if np.abs(elevation).max() > np.pi / 2.0 + 1e-6:
        raise SofaError(
            f"{name}: {key} has elevations up to {np.rad2deg(np.abs(elevation).max()):.0f} "
            "degrees, must be from -90 to 90 (are its Units right?)"
        )
    horizontal = np.cos(elevation)
    unit = np.stack(
        [horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    vectors: Floats = unit * distance[:, None]
    return vectors


def _unit(vectors: Floats, name: str) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (length > 1e-6).all():
        raise SofaError(f"{name}: ListenerView and ListenerUp do not define the axes of a head")
    unit: Floats = vectors / length
    return unit


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
