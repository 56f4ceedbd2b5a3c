"""What stops a walker is before its eyes: none of them is within a wall, and both see it."""

import numpy as np
import pytest
from walking import empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.sense_organs import EYES
from veca_marl.sim.senses import SensesCfg, make_senses

FACE_M = 1.0


def at_a_wall(age_months=None, crawls=False, **numbers):
    """Return the world and a walker that has walked straight into a wall ahead along x."""
    world = empty_world(wall("wall", thickness_m=0.1, position=(FACE_M + 0.05, 0.0, 0.0)))
    verbs = ["crawl", "stand_up"]
    walker = walker_in(world, age_months=age_months, verbs=verbs, **numbers)
    senses = make_senses(walker, ("vision",), SensesCfg(), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    walker.place((FACE_M - 0.6, 0.0, 0.0))
    world.refresh()
    if crawls:
        assert walker.crawl()
    walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    return world, walker, senses["vision"]


@pytest.mark.parametrize("crawls", [False, True])
@pytest.mark.parametrize("age_months", [None, 1.0, 6.0, 36.0])
@pytest.mark.parametrize("pitch_deg", [0.0, 12.0, 25.0, 60.0])
def test_no_eye_is_within_a_wall(age_months, crawls, pitch_deg):
    world, walker, vision = at_a_wall(age_months, crawls, head_pitch_deg=pitch_deg)
    for turned_deg in (0.0, 40.0, -40.0):
        walker.rotate_left_right_head(turned_deg)
        world.step()
        eyes = [walker.mount(name) for name in EYES]
        assert all(eye.position[0] < FACE_M - 0.002 for eye in eyes)
        apart = np.linalg.norm(eyes[0].position - eyes[1].position)
        assert apart == pytest.approx(0.045 * walker.growth.head_size, rel=1e-6)
        walker.rotate_left_right_head(-turned_deg)
    world.step()
    wall_id = world.prop("wall").object_id
    assert all((ids == wall_id).mean() > 0.3 for ids in vision.eyes.views().ids)
