"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.grab_object import GrabObject
from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.move_to_target import MoveToTarget
from veca_marl.envs.tasks.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.rotate_cube import RotateCube

__all__ = ["GrabObject", "KickTheBall", "MoveToTarget", "PileUpBlock", "RotateCube"]
