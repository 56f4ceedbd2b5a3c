"""Verbs that change how a walker moves: stepping onto things and crawling."""

import numpy as np
import pytest
from verbs import begin, do, seeing, toy
from walking import ball, box, empty_world, wall


def platform(height_m=0.15, mass_kg=0.0):
    return box(
        "platform",
        (0.6, 0.6, height_m),
        mass_kg,
        (0.6, 0.0, height_m / 2),
        interactions=["step_on"],
    )


@pytest.mark.parametrize("mass_kg", [0.0, 30.0])
def test_a_walker_steps_onto_a_low_heavy_prop_and_off_over_its_edge(mass_kg):
    world = empty_world(platform(mass_kg=mass_kg))
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    standing_m = walker.position[2]
    assert do(world, walker, "step_on")
    assert walker.position == pytest.approx([0.6, 0.0, standing_m + 0.15], abs=0.01)
    do(world, walker, "none", forward=1.0)
    assert walker.position[2] == pytest.approx(standing_m + 0.15, abs=0.025)
    for _ in range(12):
        do(world, walker, "none", forward=1.0)
    assert walker.position[0] > 1.0
    assert walker.position[2] == pytest.approx(standing_m, abs=0.025)  # the gait bobs
    assert world.prop("platform").position[0] == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("prop", [platform(0.3), platform(mass_kg=1.0)], ids=["high", "light"])
def test_high_and_light_props_are_not_stepped_on(prop):
    world = empty_world(prop)
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert not do(world, walker, "step_on")


def test_a_crawling_walker_is_slower_and_passes_below_a_bar_that_stops_an_upright_one():
    bar = box("bar", (0.1, 3.0, 0.2), 0.0, (0.6, 0.0, 0.5))
    world = empty_world(bar)
    walker = seeing(world, extra_verbs=["crawl", "stand_up"])
    begin(world)
    for _ in range(25):
        do(world, walker, "none", forward=1.0)
    assert walker.position[0] < 0.5
    assert do(world, walker, "crawl")
    assert walker.crawls
    assert not do(world, walker, "crawl")
    assert walker.bone_positions()[:, 2].max() < 0.45
    seen_below = False
    for _ in range(90):
        do(world, walker, "none", forward=1.0)
        assert walker.velocity[0] < 0.45
        if abs(walker.position[0] - 0.5) < 0.05:
            seen_below = True
            assert not do(world, walker, "stand_up")
    assert seen_below
    assert walker.position[0] > 1.2
    assert do(world, walker, "stand_up")
    do(world, walker, "none", forward=1.0)
    assert walker.position[2] > 0.28


def test_a_crawling_walker_uses_no_hand_and_a_reset_lets_it_stand():
    world = empty_world(toy(), ball(position=(0.3, 0.0, 0.1), interactions=["kick"]))
    walker = seeing(world, extra_verbs=["crawl"])
    world.freeze()
    films = []
    for _ in range(2):
        world.reset(np.random.default_rng(0))
        world.refresh()
        assert not walker.crawls
        film = []
        for verb in ["crawl", "grab", "kick", *["none"] * 10]:
            assert do(world, walker, verb, forward=1.0, turn=0.3) == (verb == "crawl")
            film.append(world.scene.positions.tobytes())
        films.append(film)
    assert films[0] == films[1]


def test_the_first_crawl_of_a_world_leaves_the_contacts_of_other_things():
    rolling = ball("rolling", position=(1.5, 0.85, 0.1))
    world = empty_world(rolling, wall(position=(1.0, 1.0, 0.0), yaw_deg=0.0))
    walker = seeing(world, extra_verbs=["crawl"])
    world.freeze()
    films = []
    for _ in range(2):
        world.reset(np.random.default_rng(0))
        world.prop("rolling").place((1.5, 0.845, 0.1), velocity=(0.8, 0.2, 0.0))
        world.refresh()
        film = []
        for verb in ["none"] * 4 + ["crawl"] + ["none"] * 6:
            do(world, walker, verb, forward=1.0)
            film.append(world.scene.positions.tobytes())
        films.append(film)
    assert films[0] == films[1]
