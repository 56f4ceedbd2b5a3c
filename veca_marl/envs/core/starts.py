"""The start of an episode as numbers: all that a reset can draw."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy

import numpy as np

from veca_marl.envs.core.game import Game
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats, Scene, matrix_to_quaternion
from veca_marl.sim.physics import Prop

Start = dict[str, tuple[float, ...]]
"""Values of the start of an episode by name, such as ``ball/position``; see `start_values`."""

NEXT_NUMBER = "next_random_number"
"""Name of the number in [0, 1) that the generator of the episode would draw after the reset."""

_DECIMALS = 6  # m and elements of rotations; processors differ in the last of 16 digits
_TOLERANCE = 1e-5


def start_state(game: Game) -> Floats:
    """Return the poses of all bones and props after `Game.reset`, rounded to 6 decimals.

    Returns:
        ``(n,)``: positions in m and rotation matrices of the bones of each player and of each prop,
        in the order in which they were added to the world.
    """
    poses = [
        array
        for player in game.players
        for array in (player.body.bone_positions(), player.body.bone_rotations())
    ]
    poses += [a for prop in game.world.props.values() for a in (prop.position, prop.rotation)]
    state = np.concatenate([np.asarray(array, np.float64).ravel() for array in poses])
    rounded: Floats = np.round(state, _DECIMALS) + 0.0  # -0.0 becomes 0.0
    return rounded


def start_values(game: Game, rng: np.random.Generator) -> Start:
    """Return all that a reset can set, rounded to 6 decimals.

    Names begin with that of a player or prop. A player has ``position`` (m) and ``quaternion``
    (x, y, z, w) of the pelvis, ``joints`` (82 angles, rad) and ``muted`` (0 or 1). A prop has
    ``position``, ``quaternion``, ``velocity`` (m/s, of its centre of mass) and ``colour`` (of its
    first primitive), with a joint also ``opening`` and ``locked``. `NEXT_NUMBER` changes with the
    number of draws, and thus with draws that set nothing of these, such as an order of targets.

    Args:
        game: A game that has just been reset.
        rng: The generator with which it was reset; it is not changed.
    """
    start: Start = {}
    for player in game.players:
        _add(start, player.name, _body_values(player.body))
    for prop in game.world.props.values():
        _add(start, prop.name, _prop_values(prop, game.world.scene))
    start[NEXT_NUMBER] = _plain(deepcopy(rng).random())
    return start


def differences(found: Start, stored: Start) -> list[str]:
    """Return the differences of two starts in words, one for each value; none if they are equal.

    Numbers may differ by 1e-5, which is more than processors do, and quaternions by their sign.
    """
    missing = [f"{name} is missing" for name in stored if name not in found]
    added = [f"{name} is new" for name in found if name not in stored]
    changed = [
        f"{name} is {_words(value)} (not {_words(stored[name])})"
        for name, value in found.items()
        if name in stored and not _equal(name, value, stored[name])
    ]
    return [*missing, *added, *changed]


def _add(start: Start, name: str, values: Mapping[str, object]) -> None:
    start.update({f"{name}/{key}": _plain(value) for key, value in values.items()})


def _body_values(body: Body) -> dict[str, object]:
    return {
        "position": body.position,
        "quaternion": matrix_to_quaternion(body.bone_rotations()[0]),
        "joints": body.joint_angles(),
        "muted": body.muted,
    }


def _prop_values(prop: Prop, scene: Scene) -> dict[str, object]:
    shown = scene.objects[prop.object_id]
    values = {
        "position": prop.position,
        "quaternion": matrix_to_quaternion(prop.rotation),
        "velocity": prop.velocity,
        "colour": scene.surfaces.colours[shown.geoms.start],
    }
    if prop.joint is None:
        return values
    return {**values, "opening": prop.opening, "locked": prop.locked}


def _plain(value: object) -> tuple[float, ...]:
    rounded = np.round(np.asarray(value, np.float64), _DECIMALS) + 0.0  # -0.0 becomes 0.0
    return tuple(rounded.ravel().tolist())


def _equal(name: str, one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    if len(one) != len(other):
        return False
    signs = (1.0, -1.0) if name.endswith("/quaternion") else (1.0,)
    return any(np.allclose(one, np.multiply(sign, other), 0.0, _TOLERANCE) for sign in signs)


def _words(value: tuple[float, ...]) -> str:
    return ", ".join(f"{number:g}" for number in value)
