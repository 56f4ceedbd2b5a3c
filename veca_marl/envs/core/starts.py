"""The start of an episode as numbers: the poses of all bodies and props."""

from __future__ import annotations

import hashlib
from copy import deepcopy

import numpy as np

from veca_marl.envs.core.game import Game
from veca_marl.sim.geometry import Floats

_DECIMALS = 6  # m and elements of rotations; processors differ in the last of 16 digits


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


def start_digest(game: Game, rng: np.random.Generator) -> str:
    """Return 16 hexadecimal digits that change with the start of an episode.

    They depend on `start_state` and on how many random numbers were drawn, so that draws that move
    nothing (the order of targets, for example) are noticed where their number changes.

    Args:
        game: A game that has just been reset.
        rng: The generator with which it was reset; it is not changed.
    """
    state = start_state(game)
    following = deepcopy(rng).integers(2**63, size=1)
    return hashlib.sha256(state.tobytes() + following.tobytes()).hexdigest()[:16]
