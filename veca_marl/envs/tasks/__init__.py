"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.pile_up_block import PileUpBlock

__all__ = ["KickTheBall", "PileUpBlock"]
