"""Small worlds for the tests of navigation."""

import math

from composed import compose

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, RoomCfg, World

BALL_M = 0.2


def shipped(playground):
    return compose(["+task=KickTheBall", f"playground={playground}"]).playground


def world_with(*props):
    """A wide floor with nothing on it but these props."""
    room = RoomCfg(lower_m=(-20.0, -20.0, 0.0), size_m=(40.0, 40.0, 3.0))
    return World(PlaygroundCfg(name="floor", rooms=[room], props=list(props), image_order=0))


def ball_at(x, y):
    return PropCfg(name="ball", shape=PropShape.sphere, size_m=[BALL_M], position_m=(x, y, BALL_M))


def wall_across(x):
    """A wall across the x axis."""
    return PropCfg(
        name="wall", shape=PropShape.wall, size_m=[0.1, 6.0, 1.5], position_m=(x, 0.0, 0.0)
    )


def walker_at(world, x=0.0, y=0.0, yaw_deg=0.0, name="walker"):
    walker = Walker(name, WalkerCfg(), world)
    walker.place((x, y, 0.0), math.radians(yaw_deg))
    return walker
