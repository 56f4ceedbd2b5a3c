"""The energy that arrives by every path from a source to a head, in one room or between two.

A reflected path is a straight line to an image (Allen & Berkley 1979), unfolded: in the copies of
the room that it passes stand mirror images of the obstacles. Between two rooms there are the direct
sound, what the walls of the source's room reflect before it passes the opening, and what those of
the head's room reflect after it: coupled rooms (Kuttruff 2016, Room Acoustics, section 5.8) as
images. A path exists if its reflections are in the room that reflects it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.sound.diffraction import add_measure, energy_past
from veca_marl.sim.sound.partitions import N_BANDS
from veca_marl.sim.sound.screens import contains_point
from veca_marl.sim.sound.silhouettes import (
    Line,
    Screens,
    Work,
    add_silhouette,
    make_work,
    write_line,
)

Numbers = NDArray[np.int64]


class Reflector(NamedTuple):
    """A room whose walls reflect a path.

    Attributes:
        lower: ``(3,)`` metres, its lower corner.
        size: ``(3,)`` metres.
        numbers: Of the screens in it.
        openings: Doorways in its walls, see `obstacles.ScreenSets`.
    """

    lower: Floats
    size: Floats
    numbers: Numbers
    openings: Screens


@compiled
def energies_inside(
    source: Floats,
    head: Floats,
    room: Reflector,
    lattice: Numbers,
    screens: Screens,
    surface_ratio: float,
) -> Floats:
    """Return the energy that arrives by all paths in one room, relative to that without obstacles.

    Args:
        source: ``(3,)`` metres in the room.
        head: ``(3,)`` metres in the room.
        room: The room.
        lattice: ``(K, 3)`` from `image_lattice`.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.

    Returns:
        ``(K, N_BANDS)`` from 0 to 1. Obstacles round the source or the head take nothing.
    """
    used = _not_round(room.numbers, source, head, screens)
    energies = np.ones((len(lattice), N_BANDS))
    work = make_work(_most_silhouettes(len(used), len(used), lattice))
    image = np.empty(3)
    for k in range(len(lattice)):
        _write_image(source, room, lattice[k], image)
        _write_energy(
            head, image, room, lattice[k], (used, used), False, screens, surface_ratio, work,
            energies[k],
        )  # fmt: skip
    return energies


@compiled
def energies_between(
    source: Floats,
    head: Floats,
    room: Reflector,
    other: Reflector,
    lattice: Numbers,
    between: Numbers,
    screens: Screens,
    surface_ratio: float,
) -> Floats:
    """Return the energy that arrives by all paths from one room to another one.

    Args:
        source: ``(3,)`` metres.
        head: ``(3,)`` metres.
        room: The source's room.
        other: The head's room.
        lattice: ``(K, 3)`` from `image_lattice`.
        between: Numbers of the screens that count between rooms.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.

    Returns:
        ``(2 K - 1, N_BANDS)`` from 0 to 1: of the direct sound, of the images in the source's room
        and of those in the head's room. 0 for paths that do not exist.
    """
    n = len(lattice)
    energies = np.zeros((2 * n - 1, N_BANDS))
    first = _not_round(between, source, head, screens)
    later = _not_round(room.numbers, source, head, screens)
    most = max(len(room.numbers), len(other.numbers))
    work = make_work(_most_silhouettes(len(first), most, lattice))
    image = np.empty(3)
    for k in range(n):
        _write_image(source, room, lattice[k], image)
        _write_energy(
            head, image, room, lattice[k], (first, later), True, screens, surface_ratio, work,
            energies[k],
        )  # fmt: skip
    later = _not_round(other.numbers, source, head, screens)
    back = np.empty(3, np.int64)
    for k in range(1, n):
        for axis in range(3):  # an even number of reflections begins at the opposite wall
            back[axis] = lattice[k, axis] if lattice[k, axis] % 2 else -lattice[k, axis]
        _write_image(head, other, back, image)
        _write_energy(
            source, image, other, back, (first, later), True, screens, surface_ratio, work,
            energies[n - 1 + k],
        )  # fmt: skip
    return energies


@kernel
def _most_silhouettes(n_first: int, n_later: int, lattice: Numbers) -> int:
    """Return how many silhouettes a path can have, see `_write_energy`."""
    most = 0
    for k in range(len(lattice)):
        most = max(most, _reflections(lattice[k]))
    return n_first + most * n_later


@compiled
def _not_round(numbers: Numbers, one: Floats, other: Floats, screens: Screens) -> Numbers:
    """Return the screens without those that contain one of two points.

    A source in a box is part of it, such as a loudspeaker in a cabinet.
    """
    kept = np.empty(len(numbers), np.int64)
    n_kept = 0
    for n in numbers:
        box = screens.centres[n], screens.rotations[n], screens.halves[n]
        if contains_point(one, *box) or contains_point(other, *box):
            continue
        kept[n_kept] = n
        n_kept += 1
    return kept[:n_kept]


@kernel
def _write_image(point: Floats, room: Reflector, reflections: Numbers, image: Floats) -> None:
    """Write the image ``(3,)`` of a point, see `image_sources`."""
    for axis in range(3):
        sign, offset = _mirror(room.lower[axis], room.size[axis], reflections[axis])
        image[axis] = sign * point[axis] + offset


@kernel
def _reflections(lattice: Numbers) -> int:
    """Return how many reflections lead to a copy ``(3,)`` of a room."""
    count: int = abs(lattice[0]) + abs(lattice[1]) + abs(lattice[2])
    return count


@kernel
def _mirror(lower: float, size: float, n: int) -> tuple[float, float]:
    """Return the sign and the offset of the coordinates in a copy of a room."""
    if n % 2 == 0:
        return 1.0, n * size
    return -1.0, 2.0 * lower + (n + 1) * size


@kernel
def _write_energy(
    start: Floats,
    image: Floats,
    room: Reflector,
    reflections: Numbers,
    used: tuple[Numbers, Numbers],
    crosses: bool,
    screens: Screens,
    surface_ratio: float,
    work: Work,
    energy: Floats,
) -> None:
    """Write the energy ``(N_BANDS,)`` that arrives by one path.

    Args:
        start: ``(3,)`` metres, the end of the path before its reflections; it may be in another
            room.
        image: ``(3,)`` metres, the image of its other end.
        room: The room that reflects it.
        reflections: ``(3,)`` copy of the room in which the image is.
        used: Numbers of the screens before the first reflection, and of those after it.
        crosses: Whether the path leads to another room: before the first reflection furniture
            counts only for the part of the path that is in its air, see `Screens`.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.
        work: Overwritten.
        energy: Overwritten.
    """
    length_m = write_line(start, image, work.start, work.frame)
    line, mirror = Line(work.start, work.frame, length_m), (work.sign, work.offset)
    begin, way, cell = work.begin, work.way, work.cell
    for axis in range(3):
        begin[axis], way[axis] = start[axis] - room.lower[axis], image[axis] - start[axis]
        cell[axis] = 0
    count, passed = 0, 0.0
    work.reflected[:] = 1.0
    for leg in range(1 + _reflections(reflections)):
        until, crossed = _next_wall(begin, way, room.size, cell, reflections)
        is_first = leg == 0
        if is_first and not _is_reflected(begin, way, room.size, reflections, until, crossed):
            energy[:] = 0.0
            return
        for axis in range(3):
            sign, offset = _mirror(room.lower[axis], room.size[axis], cell[axis])
            work.sign[axis], work.offset[axis] = sign, offset
        reach = passed * length_m, until * length_m
        numbers = used[0] if is_first else used[1]
        count = _add_leg(line, reach, numbers, is_first and crosses, screens, mirror, work, count)
        if crossed < 0:
            break
        side = 1 if (way[crossed] > 0.0) == (cell[crossed] % 2 == 0) else 0
        _lose_in_openings(line, 2 * crossed + side, room.openings, mirror, work)
        cell[crossed] += 1 if way[crossed] > 0.0 else -1
        passed = until
    energy_past(count, screens, surface_ratio, work, energy)
    for band in range(N_BANDS):
        energy[band] *= work.reflected[band]


@kernel
def _add_leg(
    line: Line,
    reach_m: tuple[float, float],
    numbers: Numbers,
    crosses: bool,
    screens: Screens,
    mirror: tuple[Floats, Floats],
    work: Work,
    count: int,
) -> int:
    """Add the silhouettes of screens between two reflections; return how many there are then.

    Args:
        line: The path.
        reach_m: Distances of the two reflections, or ends, from its start.
        numbers: Of the screens.
        crosses: See `_write_energy`; false after the first reflection.
        screens: All screens.
        mirror: See `add_silhouette`.
        work: Has `count` silhouettes; more are added.
        count: How many there are.
    """
    for n in numbers:
        low_m, high_m = reach_m
        if crosses and screens.rooms[n] >= 0:
            enter_m, leave_m = _stretch_inside(line, screens.air[n, 0], screens.air[n, 1])
            low_m, high_m = max(low_m, enter_m), min(high_m, leave_m)
            if low_m >= high_m:
                continue
        depth = add_silhouette(
            line, low_m, high_m, screens, n, mirror, work, work.rectangles[count]
        )
        if depth < np.inf:
            work.numbers[count], work.depths[count] = n, depth
            count += 1
    return count


@kernel
def _lose_in_openings(
    line: Line,
    kind: int,
    openings: Screens,
    mirror: tuple[Floats, Floats],
    work: Work,
) -> None:
    """Multiply `Work.reflected` by what the openings in a wall leave of a reflection.

    An opening does not reflect what passes it (Babinet's principle).

    Args:
        line: The path.
        kind: Which wall, see `obstacles.ScreenSets.openings`.
        openings: In the walls of the room.
        mirror: See `add_silhouette`.
        work: Overwritten.
    """
    passed, rectangle = work.passed, work.opening
    passed[:] = 0.0
    for n in range(len(openings.kinds)):
        if openings.kinds[n] != kind:
            continue
        depth = add_silhouette(line, -np.inf, np.inf, openings, n, mirror, work, rectangle)
        if depth < np.inf:
            add_measure(rectangle, openings.opens[n], passed)
    for band in range(N_BANDS):
        work.reflected[band] *= max(1.0 - passed[band], 0.0)


@kernel
def _next_wall(
    start: Floats,
    way: Floats,
    size: Floats,
    cell: NDArray[np.int64],
    reflections: NDArray[np.int64],
) -> tuple[float, int]:
    """Return the share of a line up to the next wall, and its axis: 1 and -1 if there is none.

    Args:
        start: ``(3,)`` metres, begin of the line in the coordinates of the room.
        way: ``(3,)`` metres, from there to its end.
        size: ``(3,)`` metres, the room's.
        cell: ``(3,)`` copy of the room that the line is in.
        reflections: ``(3,)`` copy of the room in which it ends.
    """
    share, crossed = 1.0, -1
    for axis in range(3):
        if cell[axis] == reflections[axis]:
            continue
        wall = (cell[axis] + (1 if way[axis] > 0.0 else 0)) * size[axis]
        at = (wall - start[axis]) / way[axis]
        if crossed < 0 or at < share:
            share, crossed = at, axis
    return share, crossed


@kernel
def _is_reflected(
    begin: Floats, way: Floats, size: Floats, reflections: Numbers, share: float, crossed: int
) -> bool:
    """Return whether a path meets the first wall that reflects it, if any, within its room.

    Args:
        begin: ``(3,)`` metres, start of the path in the coordinates of the room.
        way: ``(3,)`` metres to its end.
        size: ``(3,)`` metres, of the room.
        reflections: ``(3,)`` copy of the room in which it ends.
        share: Of the way up to that wall.
        crossed: Axis of that wall; -1 for a path that no wall reflects.
    """
    if crossed < 0:
        return True
    if not 0.0 < share < 1.0:
        return False
    for axis in range(3):
        if reflections[axis] != 0 and (way[axis] > 0.0) != (reflections[axis] > 0):
            return False
        at = begin[axis] + share * way[axis]
        if axis != crossed and not -1e-9 <= at <= size[axis] + 1e-9:
            return False
    return True


@kernel
def _stretch_inside(line: Line, lower: Floats, upper: Floats) -> tuple[float, float]:
    """Return between which distances along a line it is in a room; the first greater if never."""
    enter_m, leave_m = 0.0, line.length_m
    for axis in range(3):
        along, at = line.frame[0, axis], line.start[axis]
        if abs(along) < 1e-12:
            if not lower[axis] <= at <= upper[axis]:
                return 1.0, 0.0
            continue
        one, other = (lower[axis] - at) / along, (upper[axis] - at) / along
        enter_m, leave_m = max(enter_m, min(one, other)), min(leave_m, max(one, other))
    return enter_m, leave_m
