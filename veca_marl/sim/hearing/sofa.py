"""Reader for head-related impulse responses in SOFA files (AES69). Needs ``veca_marl[sofa]``."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.sofa_file import Field, SofaError, SofaFile, open_sofa

_METRES = ("metre", "metres", "meter", "meters", "m")
_ANGLES = {"degree": np.pi / 180.0, "degrees": np.pi / 180.0, "radian": 1.0, "radians": 1.0}
# a set with several distances: those beyond this share of the longest are kept
_SAME_DISTANCE = 0.95
# a loudspeaker closer than that touches the head
_NEAREST_M = 0.2

# convention: its type of data, and its fields that are read; AES69-2022
_CONVENTIONS = {"SimpleFreeFieldHRIR": "FIR", "FreeFieldHRIR": "FIR-E"}
_FIELDS = {
    "FIR": ("Data.IR", "Data.SamplingRate", "SourcePosition"),
    "FIR-E": ("Data.IR", "Data.SamplingRate", "SourcePosition", "EmitterPosition"),
}
_SAMPLE_RATES_HZ = (8_000.0, 200_000.0)
_LATERAL = 0.5
_FEWEST_DIRECTIONS = 4
_FEWEST_SAMPLES, _MOST_SAMPLES = 16, 1 << 16
_LARGEST_GAP_DEG = 40.0


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
class Sizes:
    """Sizes of a set of responses.

    Attributes:
        measurements: Positions of the source and of the head.
        samples: Of each response.
        emitters: Of the source, each of which is a direction; None in data of the type FIR, which
            have one response of each measurement.
    """

    measurements: int
    samples: int
    emitters: int | None

    @property
    def directions(self) -> int:
        """Number of pairs of responses."""
        return self.measurements * (self.emitters or 1)


def source_vectors(file: SofaFile, sizes: Sizes, name: str) -> Floats:
    """Return where the loudspeaker was, ``(directions, 3)`` metres in the frame of the head.

    Positions in a SOFA file are those of a room; ListenerPosition, ListenerView and ListenerUp
    state where the head was in it and where it faced. Emitters, which data of the type FIR-E have,
    are at positions relative to the source.

    Raises:
        SofaError: If a position is missing, of unknown type or units, or not finite.
    """
    count = sizes.measurements
    to_source = _vectors(file, "SourcePosition", count, name)
    if "ListenerPosition" in file:
        to_source = to_source - _vectors(file, "ListenerPosition", count, name)
    vectors = to_source[:, None] + _emitters(file, sizes, name)
    if "ListenerView" in file:
        vectors = np.einsum("mij,mej->mei", _head_axes(file, count, name), vectors)
    return vectors.reshape(-1, 3)


def _emitters(file: SofaFile, sizes: Sizes, name: str) -> Floats:
    """Return the positions of the emitters relative to the source, ``(1 or M, emitters, 3)``."""
    if sizes.emitters is None:
        return np.zeros((1, 1, 3))
    key, count = "EmitterPosition", sizes.emitters
    shape, field = file.shape(key), file.read(key)
    if shape not in ((count, 3), (count, 3, 1), (count, 3, sizes.measurements)):
        raise SofaError(
            f"{name}: {key} has shape {shape}, must be ({count}, 3, 1 or {sizes.measurements})"
        )
    if field.kind == "spherical harmonics":
        raise SofaError(
            f"{name}: contains coefficients of spherical harmonics ({key} has that Type); only "
            "responses of directions are read, Type 'cartesian' or 'spherical'"
        )
    rows = np.moveaxis(field.values.reshape(count, 3, -1), 2, 0)
    flat = Field(rows.reshape(-1, 3), field.kind, field.units)
    return _converted(flat, key, rows.shape[0] * count, name).reshape(-1, count, 3)


def _head_axes(file: SofaFile, count: int, name: str) -> Floats:
    """Return the axes of the head, ``(count, 3, 3)``: rows are forward, left and up."""
    view_kind = file.read("ListenerView")
    forward = _unit(_vectors(file, "ListenerView", count, name), name)
    up = np.tile((0.0, 0.0, 1.0), (count, 1))
    if "ListenerUp" in file:
        # AES69 gives ListenerUp the type and units of ListenerView
        stated = file.read("ListenerUp")
        frame = Field(stated.values, stated.kind or view_kind.kind, stated.units or view_kind.units)
        up = _converted(frame, "ListenerUp", count, name)
    left = _unit(np.cross(up, forward), name)
    return np.stack([forward, left, np.cross(forward, left)], axis=1)


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
    sizes = _sizes(file, _data_type(file, name), name)
    used, directions, distance_m = far_field(source_vectors(file, sizes, name), name)
    _check_coverage(directions, name)
    rate = _sample_rate(file, name) if sample_rate_hz is None else sample_rate_hz
    if not _SAMPLE_RATES_HZ[0] <= rate <= _SAMPLE_RATES_HZ[1]:
        raise SofaError(f"{name}: sampling rate {rate} Hz is outside {_SAMPLE_RATES_HZ}")
    delays = _delays(file, sizes, name)[used] / rate
    responses = _responses(file, sizes, name)[used]
    swapped = _ears_are_swapped(responses, directions, name)
    if swapped:
        responses, delays = responses[:, ::-1], delays[:, ::-1]
    _warn_of_stated_ears(file, int(swapped), name)
    return MeasuredHead(responses, directions, delays, rate, distance_m, name)


def _data_type(file: SofaFile, name: str) -> str:
    """Return the type of the data, which is that of the convention; check that fields exist."""
    if file.attribute("Conventions") != "SOFA":
        raise SofaError(f"{name}: the attribute Conventions is not SOFA")
    convention = file.attribute("SOFAConventions") or "missing"
    if convention not in _CONVENTIONS:
        raise SofaError(
            f"{name}: SOFAConventions is {convention!r}, must be one of {', '.join(_CONVENTIONS)}"
        )
    expected, stated = _CONVENTIONS[convention], file.attribute("DataType") or "missing"
    if stated != expected:
        raise SofaError(f"{name}: DataType is {stated!r}, that of {convention} is {expected}")
    missing = [field for field in _FIELDS[expected] if field not in file]
    if missing:
        raise SofaError(f"{name}: lacks {', '.join(missing)}")
    return expected


def _sizes(file: SofaFile, data_type: str, name: str) -> Sizes:
    shape = file.shape("Data.IR")
    axes = 3 if data_type == "FIR" else 4
    if len(shape) != axes or shape[1] != 2 or not _FEWEST_SAMPLES <= shape[2] <= _MOST_SAMPLES:
        form = "(directions, 2, samples)" if axes == 3 else "(measurements, 2, samples, emitters)"
        raise SofaError(
            f"{name}: Data.IR has shape {shape}, must be {form} with {_FEWEST_SAMPLES} to "
            f"{_MOST_SAMPLES} samples"
        )
    sizes = Sizes(shape[0], shape[2], None if axes == 3 else shape[3])
    if sizes.directions < _FEWEST_DIRECTIONS:
        raise SofaError(
            f"{name}: {sizes.directions} directions, at least {_FEWEST_DIRECTIONS} are needed"
        )
    return sizes


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


def _delays(file: SofaFile, sizes: Sizes, name: str) -> Floats:
    """Return the delays ``(directions, 2)`` in samples, zero if the file states none."""
    if "Data.Delay" not in file:
        return np.zeros((sizes.directions, 2))
    count, emitters = sizes.measurements, sizes.emitters or 1
    shape = file.shape("Data.Delay")
    of_each = shape if sizes.emitters is not None and len(shape) == 3 else (*shape, 1)
    if of_each not in ((2, 1), *((m, 2, e) for m in (1, count) for e in (1, emitters))):
        form = f"(1 or {count}, 2)" if sizes.emitters is None else f"(1 or {count}, 2, {emitters})"
        raise SofaError(f"{name}: Data.Delay has shape {shape}, must be {form}")
    delays = file.read("Data.Delay").values
    if not np.isfinite(delays).all():
        raise SofaError(f"{name}: Data.Delay is not finite")
    delays = np.broadcast_to(delays.reshape(of_each), (count, 2, emitters))
    return np.moveaxis(delays, 2, 1).reshape(-1, 2)


def _responses(file: SofaFile, sizes: Sizes, name: str) -> Floats:
    """Return the responses ``(directions, 2, samples)``."""
    stored = file.read("Data.IR").values
    of_each = stored.reshape(sizes.measurements, 2, sizes.samples, -1)
    responses = np.moveaxis(of_each, 3, 1).reshape(-1, 2, sizes.samples)
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
