"""Physical laws, the clock, names, and what cannot be added."""

import time

import numpy as np
import pytest
from composed import compose
from refusals import naming
from walking import STEP_S, ball, box, empty_world, film, let_pass, walker_in

from veca_marl.sim.physics import ClockCfg, World


def test_free_fall():
    """h = g t^2 / 2; Bullet's semi-implicit Euler adds g t dt / 2, which is known exactly."""
    world = empty_world(ball(position=(0.0, 0.0, 10.0)))
    let_pass(world, 1.0)
    fallen = 10.0 - world.prop("ball").position[2]
    assert fallen == pytest.approx(9.81 / 2.0 * (1.0 + world.clock.substep_s), rel=1e-3)
    assert world.prop("ball").velocity[2] == pytest.approx(-9.81, rel=1e-3)


def test_a_ball_that_rolls_without_slipping_keeps_its_speed():
    world = empty_world(ball(position=(0.0, 0.0, 0.1), rolling_friction=0.0))
    world.prop("ball").set_velocity((1.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    let_pass(world, 2.0)
    assert world.prop("ball").velocity[0] == pytest.approx(1.0, abs=1e-6)
    assert world.prop("ball").position[0] == pytest.approx(2.0, abs=1e-6)


def test_rolling_resistance_is_that_of_its_lever_arm():
    """Torque m g b over the moment 7/5 m r^2 about the point of contact."""
    world = empty_world(ball(position=(0.0, 0.0, 0.1), rolling_friction=0.002))
    world.prop("ball").set_velocity((1.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    let_pass(world, 2.0)
    slowed = 1.0 - world.prop("ball").velocity[0]
    assert slowed == pytest.approx(2.0 * 9.81 * 0.002 / (1.4 * 0.1), rel=0.05)


def test_a_sliding_ball_ends_up_rolling_at_five_sevenths_of_its_speed():
    """Angular momentum about the point of contact is kept: v = 5/7 v0 for a full sphere."""
    world = empty_world(ball(position=(0.0, 0.0, 0.1), rolling_friction=0.0))
    world.prop("ball").set_velocity((2.0, 0.0, 0.0))
    let_pass(world, 0.4)
    assert world.prop("ball").velocity[0] == pytest.approx(10.0 / 7.0, rel=0.04)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_sliding_box_is_slowed_by_its_friction(friction):
    world = empty_world(box(position=(0.0, 0.0, 0.15), friction=friction))
    let_pass(world, 0.4)
    world.prop("box").set_velocity((1.5, 0.0, 0.0))
    let_pass(world, 0.2)
    slowed = 1.5 - world.prop("box").velocity[0]
    assert slowed == pytest.approx(friction * 9.81 * 0.2, rel=0.15)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8])
def test_the_height_of_a_bounce_follows_from_the_restitution(restitution):
    """Height after the bounce = e^2 x height of the fall, within a substep's way."""
    world = empty_world(ball(position=(0.0, 0.0, 1.1), restitution=restitution))
    heights = film(world, 25)[:, world.prop("ball").row, 2] - 0.1
    landed = round(np.sqrt(2.0 / 9.81) / STEP_S)
    assert heights[landed + 1 :].max() == pytest.approx(restitution**2, abs=0.06)
    assert heights.min() > -0.02


def test_energy_is_not_created():
    """Many toys dropped at one place come to rest; overlaps give no speed."""
    toys = [box(f"box{i}", (0.2, 0.2, 0.2), 0.5, (0.03 * i, 0.0, 0.1 + 0.21 * i)) for i in range(5)]
    world = empty_world(*toys)
    fastest = 0.0
    for _ in range(100):
        world.step()
        fastest = max(fastest, *(np.linalg.norm(p.velocity) for p in world.props.values()))
    assert fastest < np.sqrt(2 * 9.81 * 1.1)
    assert all(np.linalg.norm(prop.velocity) < 0.05 for prop in world.props.values())


def test_wall_time_has_no_influence():
    def fall(pause_s):
        world = empty_world(ball(position=(0.0, 0.0, 2.0)))
        for _ in range(5):
            time.sleep(pause_s)
            world.step()
        return world.prop("ball").position

    assert fall(0.0).tobytes() == fall(0.02).tobytes()


def test_duration_of_steps():
    clock = ClockCfg(control_rate_hz=50, substeps=3)
    world = empty_world(ball(position=(0.0, 0.0, 5.0)), clock=clock)
    for _ in range(50):
        world.step()
    assert clock.step_s == pytest.approx(0.02)
    assert clock.substep_s == pytest.approx(0.02 / 3)
    assert world.prop("ball").velocity[2] == pytest.approx(-9.81, rel=1e-3)


@pytest.mark.parametrize(
    ("wrong", "nearest"),
    [(0, ("1",)), (-25, ("1",)), (26, ("25", "30")), (250, ("245", "294")), (44100, ("22050",))],
)
def test_an_agent_step_must_hold_a_whole_number_of_samples(wrong, nearest):
    with pytest.raises(ValueError, match=naming(f"control_rate_hz={wrong}", *nearest)):
        ClockCfg(control_rate_hz=wrong)


@pytest.mark.parametrize("field", ["substeps", "solver_iterations"])
def test_a_clock_needs_substeps_and_iterations(field):
    with pytest.raises(ValueError, match=naming(f"{field}=0")):
        ClockCfg(**{field: 0})


def test_names_are_unique():
    world = empty_world(ball())
    with pytest.raises(ValueError, match=naming("['floor', 'ball']")):
        world.add_prop(ball())
    with pytest.raises(ValueError, match=r"\['ball'\]"):
        empty_world(ball(), ball())
    with pytest.raises(ValueError, match=naming("'floor'", "['floor']")):
        empty_world(ball("floor"))


def test_the_error_for_an_unknown_prop_lists_the_props():
    with pytest.raises(KeyError, match=naming("'dog'", "'ball'")):
        empty_world(ball()).prop("dog")


def test_two_bodies_need_two_names():
    world = empty_world()
    walker_in(world, "walker")
    with pytest.raises(ValueError, match="'walker'"):
        walker_in(world, "walker")


def test_nothing_can_be_added_to_a_frozen_world():
    world = empty_world()
    with pytest.raises(RuntimeError, match="freeze"):
        world.reset(np.random.default_rng(0))
    world.freeze()
    with pytest.raises(RuntimeError, match=naming("frozen", "'ball'")):
        world.add_prop(ball())
    with pytest.raises(RuntimeError, match=naming("frozen", "body")):
        walker_in(world)
    with pytest.raises(RuntimeError, match="frozen"):
        world.freeze()


def test_nothing_leaves_the_room_while_a_walker_runs_about():
    """60 s of shoving toys among furniture: all stays inside, on the floor, and slow."""
    world = World(compose(["+task=KickTheBall", "playground=single_room"]).playground)
    walker = walker_in(world)
    toys = [world.prop(name) for name in ("block_red", "block_blue", "drum")]
    rng, fastest = np.random.default_rng(2), 0.0
    for step in range(round(60.0 / STEP_S)):
        toy = toys[step // 125 % 3]
        ahead = toy.position - walker.position
        bearing = np.arctan2(ahead[1], ahead[0]) - walker.yaw_rad
        walker.walk(1.0, np.clip(2.0 * np.sin(bearing) + rng.normal(0.0, 0.5), -2.0, 2.0))
        world.step()
        fastest = max(fastest, *(float(np.linalg.norm(toy.velocity)) for toy in toys))
        where = np.array([walker.position, *(prop.position for prop in world._moving)])
        assert np.abs(where[:, :2]).max() < 3.0
        assert where[:, 2].min() > -0.01
    assert max(np.linalg.norm(toy.position[:2]) for toy in toys) > 1.0
    assert fastest < 3.5


@pytest.mark.parametrize("share", [0.0, -0.1, 1.5])
def test_an_impossible_contact_share_is_refused(share):
    with pytest.raises(ValueError, match="contact_share"):
        ClockCfg(contact_share=share)


def test_worlds_of_different_contact_share_do_not_disturb_each_other():
    """Bullet keeps one number for all worlds of a process."""

    def fall(*others):
        worlds = [empty_world(ball(position=(0.0, 0.0, 0.3)), clock=clock) for clock in others]
        for world in worlds:
            world.freeze()
            world.reset(np.random.default_rng(0))
        seen = []
        for _ in range(20):
            for world in worlds:
                world.step()
            seen.append(worlds[0].prop("ball").position)
        for world in worlds:
            world.close()
        return np.array(seen)

    near, far = ClockCfg(), ClockCfg(contact_share=0.5)
    assert not np.array_equal(fall(near), fall(far)), "it matters"
    np.testing.assert_array_equal(fall(near, far), fall(near))
    np.testing.assert_array_equal(fall(far, near), fall(far))
