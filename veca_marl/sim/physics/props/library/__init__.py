"""Configurations of props with several parts or with joints, by name."""

from veca_marl.sim.physics.props.containers import cupboard_with_drawer
from veca_marl.sim.physics.props.doors import door_leaf, sliding_leaf
from veca_marl.sim.physics.props.library.containers import basket, chest
from veca_marl.sim.physics.props.toys import ToyKind, fraction_piece, key, toy

__all__ = [
    "ToyKind",
    "basket",
    "chest",
    "cupboard_with_drawer",
    "door_leaf",
    "fraction_piece",
    "key",
    "sliding_leaf",
    "toy",
]
