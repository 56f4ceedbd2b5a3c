"""Small worlds for the tests of physics and of the walking body."""

import math

import numpy as np

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, RoomCfg, World

STEP_S = 0.04


def ball(name="ball", radius_m=0.1, mass_kg=0.3, position=(1.0, 0.0, 0.1), **more):
    return PropCfg(
        name=name,
        shape=PropShape.sphere,
        size_m=[radius_m],
        mass_kg=mass_kg,
        position_m=position,
        **more,
    )


def box(name="box", edges_m=(0.3, 0.3, 0.3), mass_kg=0.5, position=(1.0, 0.0, 0.15), **more):
    return PropCfg(
        name=name,
        shape=PropShape.box,
        size_m=list(edges_m),
        mass_kg=mass_kg,
        position_m=position,
        **more,
    )


def wall(name="wall", length_m=6.0, thickness_m=0.1, position=(1.0, 0.0, 0.0), yaw_deg=90.0):
    """Return a wall across the x axis, rotated by `yaw_deg`."""
    return PropCfg(
        name=name,
        shape=PropShape.wall,
        size_m=[length_m, thickness_m, 1.2],
        position_m=position,
        yaw_deg=yaw_deg,
    )


def empty_world(*props, **more):
    """Return a world with a floor and these props."""
    room = RoomCfg(lower_m=(-20.0, -20.0, 0.0), size_m=(40.0, 40.0, 3.0))
    return World(PlaygroundCfg(name="test", rooms=[room], props=list(props), image_order=0), **more)


def walker_in(world, name="walker", place=(0.0, 0.0, 0.0), yaw_deg=0.0, **numbers):
    walker = Walker(name, WalkerCfg(**numbers), world)
    walker.place(place, math.radians(yaw_deg))
    return walker


def let_pass(world, seconds):
    for _ in range(round(seconds / STEP_S)):
        world.step()


def film(world, steps):
    """Step and return the positions of all frames, ``(steps, frames, 3)``."""
    seen = []
    for _ in range(steps):
        world.step()
        seen.append(world.scene.positions.copy())
    return np.array(seen)
