"""Props at rest sleep, and move as others as soon as something moves them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from walking import ball, box, empty_world, film, let_pass, walker_in

from veca_marl.sim.body.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BELLY
from veca_marl.sim.physics import ClockCfg, JointCfg, JointKind, PropCfg, PropShape, World

ASLEEP_S = 0.4
RESTING = ClockCfg(sleep_s=ASLEEP_S)
SUBSTEP_S = RESTING.substep_s
BLOCK = box("block", (0.1, 0.1, 0.1), 0.2, (1.0, 0.0, 0.05))


def world_of(*props, clock=RESTING):
    return empty_world(*props, clock=clock)


def let_sleep(world):
    """Step until everything that is at rest sleeps."""
    world.freeze()
    world.reset(np.random.default_rng(0))
    let_pass(world, ASLEEP_S + 0.2)


def is_simulated(world, name):
    """Return whether a prop flies up in a single physics step without weight.

    A world notices the change of gravity before its next agent step only; it is of no use
    afterwards.
    """
    world.client.setGravity(0.0, 0.0, 5.0)
    world.client.stepSimulation()
    return bool(world.prop(name).velocity.any())


@pytest.mark.parametrize(("sleep_s", "simulated"), [(ASLEEP_S, False), (math.inf, True)])
def test_what_is_at_rest_is_not_simulated_if_the_clock_says_so(sleep_s, simulated):
    world = world_of(BLOCK, clock=ClockCfg(sleep_s=sleep_s))
    let_sleep(world)
    assert is_simulated(world, "block") is simulated


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (6.0, 0.0, -9.81)])
def test_sleeping_props_move_with_a_change_of_gravity_as_awake_ones(gravity):
    """Upward, none, and sideways; a pushed prop flies on where there is none."""
    films = []
    for clock in (RESTING, ClockCfg()):
        world = world_of(BLOCK, clock=clock)
        let_sleep(world)
        world.client.setGravity(*gravity)
        films.append(film(world, 10))
    moved_m = np.abs(films[1][-1] - films[1][0]).max()
    assert moved_m > 0.05 or not any(gravity)
    np.testing.assert_allclose(films[0], films[1], atol=0.02)


def test_it_sleeps_after_the_time_of_the_clock():
    """Not before; a step is 0.04 s."""
    for seconds, simulated in ((0.6, True), (1.2, False)):
        world = world_of(BLOCK, clock=ClockCfg(sleep_s=1.0))
        world.freeze()
        world.reset(np.random.default_rng(0))
        let_pass(world, seconds)
        assert is_simulated(world, "block") is simulated


def physics_steps(world, seconds):
    """Let time pass; return how many physics steps Bullet made."""
    steps, client = [], world.client
    simulate, client.stepSimulation = client.stepSimulation, lambda: steps.append(simulate())
    let_pass(world, seconds)
    client.stepSimulation = simulate
    return len(steps)


def test_bullet_makes_no_steps_where_nothing_can_move():
    world = world_of(BLOCK)
    walker = walker_in(world)
    walker.walk(-1.0, 0.0)
    let_sleep(world)
    let_pass(world, 1.0)  # the block lies down on its edges first
    assert physics_steps(world, 0.4) == 0
    walker.place((0.0, 0.0, 0.0))
    walker.walk(1.0, 0.0)
    assert physics_steps(world, 2.0) > 0
    assert world.prop("block").position[0] > 1.2


def test_in_a_house_of_fixed_things_a_walk_is_the_same_with_and_without_bullet():
    films = []
    for observers in ([], [lambda: None]):  # an observer sees every physics step
        world = world_of(box("block", (0.4, 0.4, 0.4), 0.0, (0.8, 0.0, 0.2)), clock=ClockCfg())
        world.after_substep += observers
        walker = walker_in(world, yaw_deg=20.0)
        walker.walk(1.0, 0.3)
        steps = []
        for _ in range(40):
            steps.append(physics_steps(world, 0.04))
            films.append(world.scene.positions.copy())
        assert (0 in steps) is not bool(observers)
    assert np.array_equal(films[:40], films[40:])


def test_what_moves_is_simulated():
    """A ball at the top of its flight, and one that rolls slowly."""
    thrown = ball("thrown", position=(0.0, 0.0, 0.5))
    rolling = replace(ball("rolling", position=(3.0, 0.0, 0.1)), rolling_friction=0.0)
    film_of = {}
    for clock in (RESTING, ClockCfg()):
        world = world_of(thrown, rolling, clock=clock)
        world.freeze()
        world.reset(np.random.default_rng(0))
        world.prop("thrown").set_velocity((0.0, 0.0, 3.0))
        world.prop("rolling").set_velocity((0.05, 0.0, 0.0))
        film_of[clock.sleep_s] = film(world, 25)
    np.testing.assert_array_equal(film_of[ASLEEP_S], film_of[math.inf])


def kick(world):
    world.prop("block").set_velocity((2.0, 0.0, 0.0))


def put_up(world):
    world.prop("block").place((1.0, 0.0, 0.6))


def throw_a_ball(world):
    world.prop("ball").place((0.6, 0.0, 0.1), velocity=(3.0, 0.0, 0.0))


def walk_against_it(world):
    walker = world.walker
    walker.place((0.5, 0.0, 0.0))
    walker.walk(1.0, 0.0)


@pytest.mark.parametrize("happens", [kick, put_up, throw_a_ball, walk_against_it])
def test_a_sleeping_prop_moves_as_an_awake_one(happens):
    """It ends where it would have ended without sleep, within the way of one physics step."""
    ends = []
    for clock in (RESTING, ClockCfg()):
        world = world_of(BLOCK, ball("ball", position=(-3.0, 0.0, 0.1)), clock=clock)
        world.walker = walker_in(world, place=(-2.0, 0.0, 0.0))
        let_sleep(world)
        start = world.prop("block").position
        happens(world)
        let_pass(world, 0.5)
        ends.append(world.prop("block").position - start)
    asleep, awake = ends
    assert np.linalg.norm(awake) > 0.05
    np.testing.assert_allclose(asleep, awake, atol=3.0 * SUBSTEP_S + 0.01)


def test_a_collision_with_a_sleeping_prop_keeps_the_momentum():
    """Of a ball that hits another one centrally, without friction."""
    balls = [
        replace(ball(name, position=(x, 0.0, 0.1)), friction=0.0, rolling_friction=0.0)
        for name, x in (("hit", 1.0), ("hitting", -1.0))
    ]
    world = world_of(*balls)
    let_sleep(world)
    world.prop("hitting").set_velocity((3.0, 0.0, 0.0))
    let_pass(world, 1.0)
    masses = [world.prop(name).cfg.mass_kg for name in ("hit", "hitting")]
    speeds = [world.prop(name).velocity[0] for name in ("hit", "hitting")]
    assert speeds[0] > 0.5
    assert np.dot(masses, speeds) == pytest.approx(masses[1] * 3.0, rel=1e-3)


@pytest.mark.parametrize("under_kg", [1.0, 0.0])
def test_a_sleeping_prop_falls_when_what_is_under_it_is_taken_away(under_kg):
    under = PropCfg("under", PropShape.box, [0.3, 0.3, 0.3], (1.0, 0.0, 0.15), mass_kg=under_kg)
    world = world_of(under, replace(BLOCK, position_m=(1.0, 0.0, 0.35)))
    let_sleep(world)
    assert not world.prop("block").velocity.any()
    world.prop("under").place((-5.0, 0.0, 0.15))
    let_pass(world, 1.0)
    assert world.prop("block").position[2] == pytest.approx(0.05, abs=2e-3)


def test_a_prop_that_woke_because_the_one_beside_it_was_put_elsewhere_sleeps_again():
    world = world_of(BLOCK, replace(BLOCK, name="other", position_m=(1.1, 0.0, 0.05)))
    let_sleep(world)
    world.prop("other").place((-5.0, 0.0, 0.05))
    let_pass(world, 2.0 * ASLEEP_S + 0.2)
    assert not is_simulated(world, "block")


def cupboard_with(content):
    cupboard = PropCfg("cupboard", PropShape.box, [0.5, 0.4, 0.3], (-1.0, 0.0, 0.15))
    joint = JointCfg(JointKind.slide, axis=(1.0, 0.0, 0.0), range_m=0.25, parent="cupboard")
    tray = PropCfg(
        "tray", PropShape.box, [0.3, 0.3, 0.02], (-1.0, 0.0, 0.32), mass_kg=1.0, joint=joint
    )
    return [cupboard, tray, replace(content, position_m=(-1.0, 0.0, 0.38))]


@pytest.mark.parametrize("asleep", [True, False])
def test_a_motor_moves_a_sleeping_drawer_and_what_lies_in_it(asleep):
    clock = RESTING if asleep else ClockCfg()
    world = world_of(*cupboard_with(BLOCK), clock=clock)
    let_sleep(world)
    before = world.prop("block").position
    assert world.prop("tray").open()
    let_pass(world, 3.0)
    assert world.prop("tray").opening == pytest.approx(1.0, abs=1e-3)
    assert world.prop("block").position[0] - before[0] == pytest.approx(0.25, abs=0.03)
    if asleep:
        assert not is_simulated(world, "block")


def test_a_drawer_that_is_put_at_an_opening_wakes_what_lies_on_it():
    world = world_of(*cupboard_with(replace(BLOCK, size_m=[0.06] * 3)))
    let_sleep(world)
    world.prop("tray").place((-5.0, 0.0, 0.32))
    let_pass(world, 1.0)
    assert world.prop("block").position[2] < 0.36


@pytest.mark.parametrize("wall_kg", [0.0, 100.0])
def test_a_motor_goes_on_when_nothing_blocks_it_any_more(wall_kg):
    wall = PropCfg("wall", PropShape.box, [0.1, 0.4, 0.6], (-0.7, 0.0, 0.3), mass_kg=wall_kg)
    world = world_of(*cupboard_with(BLOCK), wall)
    let_sleep(world)
    world.prop("tray").open()
    let_pass(world, 2.0)
    assert world.prop("tray").opening < 0.5
    world.prop("wall").place((5.0, 0.0, 1.0))
    let_pass(world, 2.0)
    assert world.prop("tray").opening == pytest.approx(1.0, abs=1e-3)


def test_a_world_that_slept_returns_to_the_built_state_bit_by_bit():
    """Whatever slept or woke before, an episode is that of a fresh world."""

    def fresh():
        world = world_of(BLOCK, replace(BLOCK, name="other", position_m=(1.0, 0.0, 0.15)))
        world.walker = walker_in(world)
        world.freeze()
        return world

    def play(world):
        world.reset(np.random.default_rng(0))
        world.walker.place((0.0, 0.0, 0.0))
        world.refresh()
        still = film(world, 30)
        world.walker.walk(1.0, 0.0)
        return np.concatenate([still, film(world, 40)])

    used, first = fresh(), play(fresh())
    assert np.ptp(first[30:], axis=0).max() > 0.1
    for steps in (0, 7, 30, 60):
        used.reset(np.random.default_rng(1))
        let_pass(used, 0.04 * steps)
        used.prop("other").place((0.5, 0.5, 0.4))  # awake in Bullet only from the next step on
        np.testing.assert_array_equal(play(used), first)


def test_a_prop_at_rest_that_carries_a_moving_one_is_simulated_bit_by_bit_as_without_sleep():
    """It may sleep, but what touches it moves. A kick adds nothing to its velocity but the kick."""
    plate = box("plate", (2.0, 1.0, 0.1), 1.0, (1.0, 0.0, 0.05))
    rolling = replace(ball("rolling", position=(0.4, 0.0, 0.2)), rolling_friction=0.0)
    films = []
    for clock in (RESTING, ClockCfg()):
        world = world_of(plate, rolling, clock=clock)
        world.freeze()
        world.reset(np.random.default_rng(0))
        world.prop("rolling").set_velocity((0.1, 0.0, 0.0), (0.0, 1.0, 0.0))
        let_pass(world, 2.0 * ASLEEP_S)
        world.prop("plate").set_velocity((0.0, 1.0, 0.0))
        films.append(film(world, 20))
    np.testing.assert_array_equal(*films)
    assert np.ptp(films[0][:, world.prop("plate").row, 1]) > 0.02


def test_a_joint_level_body_wakes_what_it_falls_on():
    """It pushes the block aside or rests on it, but not in it."""
    world = world_of(replace(BLOCK, position_m=(0.0, 0.0, 0.05)), box("far", position=(3, 0, 0.15)))
    body = Humanoid("body", HumanoidCfg(), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    body.place((0.0, 0.0, 5.0), 0.0, ON_BELLY)
    let_pass(world, ASLEEP_S + 0.2)
    body.place((0.0, 0.0, 0.3), 0.0, ON_BELLY)
    before = world.prop("block").position
    let_pass(world, 1.5)
    assert np.abs(world.prop("block").position - before).max() > 1e-3
    assert world.overlap_m(body.body_id, world.prop("block").body_id) < 0.01
    assert not world.prop("far").velocity.any()


def test_a_held_prop_does_not_sleep():
    world = world_of(BLOCK)
    world.walker = walker_in(world, place=(0.7, 0.0, 0.0))
    let_sleep(world)
    assert world.walker.grab(world.prop("block"))
    let_pass(world, 2.0 * ASLEEP_S)
    world.walker.release()
    let_pass(world, 1.0)
    assert world.prop("block").position[2] == pytest.approx(0.05, abs=2e-3)


@pytest.mark.parametrize("wrong", [0.0, -1.0])
def test_a_time_that_is_not_positive_is_refused(wrong):
    with pytest.raises(ValueError, match="sleep_s"):
        ClockCfg(sleep_s=wrong)


def test_worlds_without_sleep_are_the_default():
    assert World(empty_world().playground).clock.sleep_s == math.inf
