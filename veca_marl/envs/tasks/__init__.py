"""The tasks. Importing this package registers them all."""

from veca_marl.envs.tasks.kick_the_ball import KickTheBall

__all__ = ["KickTheBall"]
