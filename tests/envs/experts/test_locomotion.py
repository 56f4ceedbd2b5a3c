"""Getting about: every body that experts of games may have comes to places and turns."""

import math

import numpy as np
import pytest
from seeking import world_with

from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.tasks.player_starts import place_player
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg, JointActionKind
from veca_marl.sim.body.walker import Walker, WalkerCfg

BODIES = {
    "walker": (Walker, WalkerCfg()),
    "mitten": (Humanoid, HumanoidCfg(detail=Detail.mitten)),
    "mitten_position": (
        Humanoid,
        HumanoidCfg(detail=Detail.mitten, action=JointActionKind.position),
    ),
    "full": (Humanoid, HumanoidCfg()),
}


@pytest.fixture(scope="module", params=BODIES)
def mover(request):
    """A body of each kind as a player on a wide floor."""
    world = world_with()
    kind, cfg = BODIES[request.param]
    player = Player("one", "agents", kind("one", cfg, world))
    world.freeze()
    yield world, player
    world.close()


def start(mover):
    world, player = mover
    world.reset(np.random.default_rng(0))
    place_player(player, np.zeros(2), 0.0)
    return locomotion_of(player, world.clock.step_s)


def let(mover, wish):
    world, player = mover
    player.body.act(player.body.encode(wish))
    world.step()
    return player.body


@pytest.mark.parametrize("aside_deg", [0.0, 60.0, -60.0, 130.0, -130.0, 180.0])
def test_it_comes_to_places_all_around(mover, aside_deg):
    place = 1.8 * np.array([math.cos(math.radians(aside_deg)), math.sin(math.radians(aside_deg))])
    legs = start(mover)
    ways = (let(mover, legs.to(place)).position[:2] for _ in range(25 * 16))
    assert any(math.dist(here, place) < 0.3 for here in ways)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_to_either_side(mover, side):
    legs = start(mover)
    turned, before = 0.0, mover[1].body.forward
    for _ in range(25 * 6):
        now = let(mover, legs.turn(side)).forward
        turned += math.atan2(before[0] * now[1] - before[1] * now[0], float(before @ now))
        before = now
    assert side * turned > math.pi / 2.0


def test_it_stays_near_while_it_turns(mover):
    legs = start(mover)
    ways = [let(mover, legs.turn(1.0)).position[:2] for _ in range(25 * 15)]
    assert max(np.linalg.norm(ways, axis=1)) < 1.2


def test_it_goes_back(mover):
    """At once, and after it has gone ahead: at least 0.1 m/s, facing where it did, on its knees."""
    legs = start(mover)
    for horizon_s in (0, 1, 2):
        for _ in range(25 * horizon_s):
            let(mover, legs.to(np.array([9.0, 0.0])))
        begin_m = mover[1].body.position[0]
        for _ in range(25 * 3):
            body = let(mover, legs.back())
        assert body.position[0] < begin_m - 0.3
        assert body.forward[0] > 0.5


def test_at_rest_its_head_is_still(mover):
    legs = start(mover)
    for _ in range(25):
        let(mover, legs.to(np.array([9.0, 0.0])))
    heads = [let(mover, legs.rest()).mount("head").position for _ in range(50)]
    speeds_mps = np.linalg.norm(np.diff(heads[25:], axis=0), axis=1) * 25
    assert np.mean(speeds_mps) < 0.05
