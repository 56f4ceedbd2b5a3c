"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.envs.tasks.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.put_down_block import PutDownBlock

__all__ = ["KickTheBall", "PileUpBlock", "PutDownBlock"]
