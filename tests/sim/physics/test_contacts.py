"""Contacts: bodies that meet or press on each other, and none before."""

import pytest
from walking import ball, box, empty_world

from veca_marl.sim.physics import ClockCfg

SHARES = [0.02, 1.0]


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize(("gap_m", "touches"), [(0.002, False), (-0.002, True)])
def test_a_ball_touches_a_wall_only_where_they_meet(share, gap_m, touches):
    """It falls along the wall. Bullet lists points of contact before surfaces meet."""
    falling = ball(position=(0.25 + gap_m, 0.0, 2.0), friction=0.0)
    world = empty_world(
        box(edges_m=(0.3, 4.0, 3.0), mass_kg=0.0, position=(0.0, 0.0, 1.5)),
        falling,
        clock=ClockCfg(control_rate_hz=245, substeps=1, contact_share=share),
    )
    world.freeze()
    world.step()
    assert world.prop("ball").touches(world.prop("box").body_id) is touches
    assert not world.prop("ball").touches(world.floor_id)


@pytest.mark.parametrize("share", SHARES)
def test_a_box_at_rest_touches_the_floor_in_every_step(share):
    world = empty_world(box(), clock=ClockCfg(contact_share=share))
    world.freeze()
    for _ in range(20):
        world.step()
    for _ in range(50):
        world.step()
        assert world.prop("box").touches(world.floor_id)
