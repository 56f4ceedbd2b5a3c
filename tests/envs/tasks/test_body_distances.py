"""Distances of a task have to fit the size of the bodies that play it, or are refused."""

import math

import numpy as np
import pytest
from composed import compose
from contests import game_of
from refusals import naming

from veca_marl.checks.starts import overlaps
from veca_marl.config import ConfigError
from veca_marl.envs.tasks.floors.outlines import outlines_overlap, placed, start_outline
from veca_marl.envs.tasks.floors.places import place_player
from veca_marl.sim.physics import penetration_m

NARROW = ["task.radius_m=0.5", "task.start_share=0.6"]  # 0.6 m between opponents


def apart_m(outline):
    """Least distance of two bodies that face each other, by bisection."""
    near, far = 0.0, 3.0
    while far - near > 1e-4:
        middle = (near + far) / 2.0
        other = placed(outline, np.array([middle, 0.0]), math.pi)
        near, far = (middle, far) if outlines_overlap(outline, other) else (near, middle)
    return far


@pytest.mark.parametrize("sizes", [[], ["body.age_months=2"], ["body.age_months=36"]])
def test_outlines_touch_where_the_bodies_do(sizes):
    """Within 1 cm, which is more than the skin of a hand."""
    game = game_of("PushOut1v1", "body=mitten", *sizes)
    game.reset(np.random.default_rng(0))
    one, other = game.players
    least_m = apart_m(start_outline(one.body.cfg))
    for distance_m, penetrates in ((least_m - 0.01, True), (least_m + 0.01, False)):
        place_player(one, np.zeros(2), 0.0)
        place_player(other, np.array([distance_m, 0.0]), math.pi)
        ids = one.body.body_id, other.body.body_id
        assert (penetration_m(game.world.client, *ids) > 0.0) == penetrates
    game.close()


def test_a_ring_in_which_large_bodies_overlap_at_every_start_is_refused():
    with pytest.raises(ConfigError, match=naming("start_share=0.6", "radius_m=0.5", "0.956 m")):
        compose(["+task=PushOut1v1", "body=mitten", "body.age_months=36", *NARROW])


@pytest.mark.parametrize("body", ["mitten", "walker"])
def test_a_ring_that_is_not_refused_has_a_start_in_every_episode(body):
    """Also where the headings of one team often leave none to the other."""
    game = game_of("PushOut1v1", f"body={body}", "body.age_months=18", *NARROW)
    for seed in range(12):
        game.reset(np.random.default_rng(seed))
        assert not overlaps(game)
    game.close()


@pytest.mark.parametrize("task", ["PushOut1v1", "PushOut2v2"])
def test_starts_within_the_walls_are_refused(task):
    """The pelvis is in the ring; head or feet would be beyond the walls."""
    numbers = ["task.radius_m=3.0", "task.start_share=0.9", "task.spread_deg=180"]
    with pytest.raises(ConfigError, match=naming("start_share=0.9", "radius_m=3.0", "3.00 m")):
        compose([f"+task={task}", "playground=simple", *numbers])


@pytest.mark.parametrize("task", ["MultiAgentNav", "ObjectNav", "MazeNav"])
@pytest.mark.parametrize("sizes", [[], ["body.age_months=36"]])
def test_a_reach_within_the_body_itself_is_refused(task, sizes):
    with pytest.raises(ConfigError, match=naming("task.reach_m=0.1", "reached")):
        compose([f"+task={task}", "body=walker", "task.reach_m=0.1", *sizes])


@pytest.mark.parametrize("task", ["MultiAgentNav", "ObjectNav", "ObjectPhysNav"])
@pytest.mark.parametrize("months", [1, 12, 24, 36])
def test_the_default_reach_is_not_refused_at_any_age(task, months):
    cfg = compose([f"+task={task}", "body=mitten", f"body.age_months={months}"])
    assert cfg.game.body.age_months == months
