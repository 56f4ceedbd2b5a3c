"""Saved states of Bullet that can be restored in any client with the same bodies.

PyBullet restores poses, velocities and contacts from a file. Its contacts name the two things that
touch by numbers that Bullet gives anew whenever a filter of collisions changes, as it does at the
start of an episode; contacts with other numbers are dropped. By the same numbers Bullet orders the
contacts that it solves. So the numbers in a state are read and replaced here: the format is that of
Bullet's serializer in double precision for 64 bits (`btBulletFile.cpp`, `btCollisionObject.h` and
`btMultiBodyLinkCollider.h` of Bullet 3.2).
"""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pybullet

from veca_marl.sim.physics.bullet_client import BulletClient

_HEADER = b"BULLETd-v"
_FIRST = 12  # bytes of the header
_CHUNK = struct.Struct("<4siQii")  # code, bytes of the content, pointer, number of type, count
_BODY, _LINK_COLLIDER, _LINK_COLLIDER_BYTES = b"MBDY", b"MBLC", 520
_ACTIVATION = 480  # offsets in the data of a link's collision object
_FILTER = struct.Struct("<iii")  # group, mask, number
_FILTER_AT, _NUMBER_AT = 492, 500
_OWNER = struct.Struct("<Qi")  # pointer to the body, link
_OWNER_AT = 504
_ASLEEP = 2  # `ISLAND_SLEEPING`

# PyBullet saves to files only; on a disk that takes several times as long as in memory
_DESCRIPTORS = Path("/proc/self/fd")
_FILES_IN_MEMORY = hasattr(os, "memfd_create") and _DESCRIPTORS.is_dir()


class _Collider(NamedTuple):
    """The collision object of one link in a saved state.

    Attributes:
        at: Where its data begin.
        body: Which of the bodies it belongs to, in the order of their creation.
        link: -1 is the base.
        group: Of its filter.
        mask: Likewise.
        number: Bullet's number.
        asleep: Whether Bullet does not simulate it.
    """

    at: int
    body: int
    link: int
    group: int
    mask: int
    number: int
    asleep: bool


def saved_state(client: BulletClient) -> bytes:
    """Return poses, velocities and contacts of all bodies in Bullet's own format.

    Filters of collisions, motors of joints and gravity are not in it.
    """
    if not _FILES_IN_MEMORY:
        with tempfile.TemporaryDirectory() as folder:
            return _saved_to(Path(folder) / "world.bullet", client)
    descriptor = os.memfd_create("world.bullet")
    try:
        return _saved_to(_DESCRIPTORS / str(descriptor), client)
    finally:
        os.close(descriptor)


def _saved_to(path: Path, client: BulletClient) -> bytes:
    client.saveBullet(str(path))
    return path.read_bytes()


def sleeping_bodies(client: BulletClient, state: bytes) -> frozenset[int]:
    """Return PyBullet's ids of the bodies that Bullet did not simulate in a saved state."""
    asleep = {each.body for each in _colliders(state) if each.asleep}  # a fixed base never is
    return frozenset(client.getBodyUniqueId(number) for number in asleep)


def solving_order(state: bytes) -> list[tuple[int, int]]:
    """Return the bodies and links of a saved state in the order in which contacts are solved.

    Equal episodes need equal orders. Bodies are numbered in the order of their creation.
    """
    colliders = list(_colliders(state))
    return [colliders[index][1:3] for index in _order(colliders)]


def solve_in_order(client: BulletClient, order: Sequence[tuple[int, int]]) -> None:
    """Let Bullet solve contacts in an order of `solving_order`; present contacts may get lost."""
    state = saved_state(client)
    if solving_order(state) == list(order):
        return
    colliders = {each[1:3]: each for each in _colliders(state)}
    for body, link in order:  # each gets the next number
        _, _, _, group, mask, _, _ = colliders[body, link]
        client.setCollisionFilterGroupMask(client.getBodyUniqueId(body), link, group, mask)


def restore_state(client: BulletClient, state: bytes) -> None:
    """Return to a state of `saved_state`, of this or of another client with the same bodies.

    Raises:
        pybullet.error: If the state has other bodies, or is damaged.
    """
    saved, present = list(_colliders(state)), list(_colliders(saved_state(client)))
    if [each[1:3] for each in saved] != [each[1:3] for each in present]:
        raise pybullet.error("the saved state has other bodies")
    if _order(saved) != _order(present):
        solve_in_order(client, solving_order(state))
        present = list(_colliders(saved_state(client)))
    renamed = bytearray(state)
    for before, now in zip(saved, present, strict=True):
        struct.pack_into("<i", renamed, before.at + _NUMBER_AT, now.number)
    with tempfile.TemporaryDirectory() as folder:  # a new name: Bullet caches files by their names
        path = Path(folder) / "world.bullet"
        path.write_bytes(renamed)
        client.restoreState(fileName=str(path))


def _order(colliders: list[_Collider]) -> list[int]:
    """Return the colliders in the order of Bullet's numbers."""
    return sorted(range(len(colliders)), key=lambda index: colliders[index].number)


def _colliders(state: bytes) -> Iterator[_Collider]:
    """Yield the collision objects of all links.

    Raises:
        pybullet.error: If this is no state of `saved_state`.
    """
    if not state.startswith(_HEADER):
        raise pybullet.error("this is no saved state of Bullet for 64 bits in double precision")
    bodies: dict[int, int] = {}
    found = []
    at = _FIRST
    while at + _CHUNK.size <= len(state):
        code, size, pointer, _, _ = _CHUNK.unpack_from(state, at)
        at += _CHUNK.size
        if size < 0 or at + size > len(state):
            raise pybullet.error("the saved state is cut off")
        if code == _BODY:
            bodies[pointer] = len(bodies)
        elif code == _LINK_COLLIDER and size == _LINK_COLLIDER_BYTES:
            found.append(at)
        at += size
    for at in found:
        owner, link = _OWNER.unpack_from(state, at + _OWNER_AT)
        group, mask, number = _FILTER.unpack_from(state, at + _FILTER_AT)
        (activation,) = struct.unpack_from("<i", state, at + _ACTIVATION)
        if owner not in bodies:
            raise pybullet.error("the saved state is damaged")
        yield _Collider(at, bodies[owner], link, group, mask, number, activation == _ASLEEP)
