"""Positions in a SOFA file: coordinate systems, units, and the frame of the listener."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.sofa.fields import Field, SofaFile
from veca_marl.sim.hearing.sofa.measured_head import SofaError

_METRES = ("metre", "metres", "meter", "meters", "m")
_ANGLES = {"degree": np.pi / 180.0, "degrees": np.pi / 180.0, "radian": 1.0, "radians": 1.0}
# a set with several distances: those beyond this share of the longest are kept
_SAME_DISTANCE = 0.95
# a loudspeaker closer than that touches the head
_NEAREST_M = 0.2


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
