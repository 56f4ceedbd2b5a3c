"""Walkers that see and choose verbs."""

import numpy as np
from walking import ball, walker_in

from veca_marl.sim.body.walker import WalkCommand
from veca_marl.sim.vision import Camera, open_eyes

VERBS = ["grab", "release", "kick"]


def toy(name="toy", position=(0.7, 0.0, 0.05), **more):
    return ball(name, radius_m=0.05, position=position, interactions=["grab"], **more)


def seeing(world, name="walker", place=(0.0, 0.0, 0.0), yaw_deg=0.0, extra_verbs=()):
    verbs = [*VERBS, *extra_verbs]
    walker = walker_in(world, name, place, yaw_deg, verbs=verbs, head_pitch_deg=25.0)
    open_eyes(world.scene, walker, Camera(42, 42))
    return walker


def do(world, walker, verb, forward=0.0, turn=0.0):
    """Play one step in which a walker chooses a verb; return whether it had an effect."""
    walker.act(walker.encode(WalkCommand(forward, turn, verb=verb)))
    world.step()
    assert walker.verb_was_refused == (verb != "none" and walker.applied_verb is None)
    return walker.applied_verb is not None


def begin(world):
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.refresh()
