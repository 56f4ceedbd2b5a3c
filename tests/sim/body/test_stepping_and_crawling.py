"""Verbs that change how a walker moves: stepping onto things and crawling."""

import numpy as np
import pytest
from verbs import begin, do, seeing, toy
from walking import ball, box, empty_world, wall

from veca_marl.sim.body.proprioception import ProprioceptionCfg, ProprioceptionSense
from veca_marl.sim.physics import ClockCfg


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


def test_a_walker_steps_onto_a_small_thing_at_its_feet_which_it_does_not_see():
    step = box("step", (0.3, 0.3, 0.1), 0.0, (0.35, 0.0, 0.05), interactions=["step_on"])
    world = empty_world(step)
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert not walker.is_visible(world.prop("step"))
    assert do(world, walker, "step_on")
    assert walker.position[0] == pytest.approx(0.35, abs=0.01)


@pytest.mark.parametrize("height_m", [0.3, 1.2])
def test_a_walker_does_not_step_through_a_wall(height_m):
    between = box("wall", (0.05, 3.0, height_m), 0.0, (0.2, 0.0, height_m / 2))
    world = empty_world(platform(), between)
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    here = walker.position
    assert not walker.can_step_on(world.prop("platform"))
    assert walker.position == pytest.approx(here)


def test_a_walker_does_not_step_to_where_something_heavy_stands():
    load = box("load", (0.3, 0.3, 0.3), 50.0, (0.6, 0.0, 0.3))
    world = empty_world(platform(), load)
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert not do(world, walker, "step_on")
    assert not do(world, walker, "none")  # and it is where it was
    assert walker.position[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    world.prop("load").place((3.0, 0.0, 0.15))
    assert do(world, walker, "step_on")


def test_a_held_prop_is_not_thrown_by_a_step_onto_something():
    toy_at = (0.75, -0.2, 0.2)  # beside where the hand will be
    resting = ball("resting", 0.05, 0.2, toy_at)
    world = empty_world(platform(), resting, clock=ClockCfg(substeps=1))
    world.add_prop(box("toy", (0.1, 0.1, 0.1), 0.3, (0.25, 0.0, 0.05), interactions=["grab"]))
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert walker.grab(world.prop("toy"))
    do(world, walker, "none")
    assert walker.step_on(world.prop("platform"))
    for _ in range(3):
        world.step()
        assert np.linalg.norm(world.prop("toy").velocity) < 2.0
        assert np.linalg.norm(world.prop("resting").velocity) < 2.0
    assert walker.release()
    world.step()
    assert np.linalg.norm(world.prop("toy").velocity[:2]) < 1.0


@pytest.mark.parametrize("width_m", [0.1, 0.4, 1.2])
def test_a_walker_does_not_stand_up_below_a_table(width_m):
    """Also where the nearest side of its top is far: the contact is then vertical."""
    top = box("top", (width_m, width_m, 0.04), 0.0, (4.0, 0.0, 0.5))
    carpet = box("carpet", (2.0, 2.0, 0.01), 0.0, (0.0, 0.0, 0.005))
    world = empty_world(top, carpet)
    walker = seeing(world, extra_verbs=["crawl", "stand_up"])
    begin(world)
    assert walker.crawl()
    assert walker.stand_up(), "what is beneath it is no obstacle"
    assert walker.crawl()
    world.prop("top").place((0.0, 0.0, 0.5))
    world.step()
    assert not walker.stand_up()
    assert walker.crawls


@pytest.mark.parametrize("deg", [10.0, 30.0, -3.0])
def test_the_head_of_a_crawling_walker_follows_its_commands(deg):
    world = empty_world()
    walker = seeing(world, extra_verbs=["crawl", "stand_up"])
    begin(world)
    assert walker.crawl()

    def down_deg():
        return np.degrees(np.arcsin(-walker.mount("head").rotation[2, 0]))

    before = down_deg()
    walker.rotate_up_down_head(deg)
    world.step()
    assert down_deg() - before == pytest.approx(deg, abs=1e-6)
    walker.rotate_up_down_head(-90.0)  # to its limit
    walker.rotate_up_down_head(20.0)
    world.step()
    limit = down_deg()
    walker.rotate_up_down_head(-20.0)
    world.step()
    assert limit - down_deg() == pytest.approx(20.0, abs=1e-6)


def felt(world, walker, *verbs):
    """Return greatest joint speed, head speed, head acceleration of the steps of some verbs."""
    sense = ProprioceptionSense(ProprioceptionCfg(), walker, world)
    rows = []
    for verb in verbs:
        done = do(world, walker, verb)
        assert done or verb == "none"
        vector = sense.read()["proprioception"]
        speeds = vector[sense.parts["joint_velocities"]]
        force = np.linalg.norm(vector[sense.parts["head_acceleration"]])
        rows.append([np.abs(speeds).max(), np.linalg.norm(walker.head_motion()[0]), force])
    return np.array(rows)


@pytest.mark.parametrize(
    "verbs", [["step_on", "none"], ["crawl", "none", "stand_up", "none"], ["grab", "release"]]
)
def test_a_change_of_posture_is_no_motion(verbs):
    """The picture of the body changes at once: joints and head would have moved at 10 m/s."""
    world = empty_world(platform(), toy(position=(0.5, 0.35, 0.05)))
    walker = seeing(world, extra_verbs=["step_on", "crawl", "stand_up"])
    begin(world)
    seen = felt(world, walker, "none", *verbs)
    np.testing.assert_allclose(seen[:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(seen[:, 2], 9.81, atol=1e-3)


def test_walking_over_an_edge_is_no_fall_within_one_step():
    world = empty_world(platform())
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert do(world, walker, "step_on")
    for _ in range(4):
        do(world, walker, "none", forward=1.0)
    heights_m, falling_mps = [walker.position[2]], []
    for _ in range(8):
        do(world, walker, "none", forward=1.0)
        heights_m.append(walker.position[2])
        falling_mps.append(-walker.head_motion()[0][2])
    assert np.diff(heights_m).min() < -0.1, "it has walked over the edge"
    assert max(falling_mps) < 0.5, "the gait moves the head by up to 0.4 m/s"


def test_on_a_prop_voice_and_footsteps_move_with_the_walker(monkeypatch):
    """Its surface, as a ray meets it, differs by rounding from step to step: that is no edge."""
    world = empty_world(platform())
    walker = seeing(world, extra_verbs=["step_on"])
    begin(world)
    assert do(world, walker, "step_on")
    placed = []
    monkeypatch.setattr(walker._mouth, "teleport", placed.append)
    for _ in range(5):
        do(world, walker, "none", forward=1.0)
    assert walker._stands_on_prop
    assert placed == []


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
