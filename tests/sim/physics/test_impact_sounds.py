"""Sounds of impacts: silent at rest, louder with the impulse, deterministic."""

import math
from dataclasses import replace

import numpy as np
import pytest
from composed import compose
from scipy.special import spherical_jn

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.physics import ClockCfg, JointCfg, JointKind, LockCfg, PlaygroundCfg, World
from veca_marl.sim.physics.impact_sounds import ImpactCfg, joint_stop, prop_modes
from veca_marl.sim.physics.props import PartCfg, PropCfg, PropShape
from veca_marl.sim.sound.modal_synthesis import SPHERE_ROOTS, Material
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS


def ball(height_m, material=Material.wood):
    return PropCfg(
        "ball", PropShape.sphere, [0.1], (0.0, 0.0, height_m), mass_kg=0.3, material=material
    )


def rod(material=Material.wood, length=0.4, thickness=0.02):
    size = [length, 0.05, thickness]
    return PropCfg(
        "rod", PropShape.box, size, (1.5, 1.5, thickness / 2), mass_kg=0.2, material=material
    )


def world_with(*props, **impacts):
    impacts.setdefault("present", True)
    return World(PlaygroundCfg("test", props=list(props), impacts=ImpactCfg(**impacts)))


def emitted(world, name, n_steps, act=lambda step: None):
    """Samples that a source emits after a reset, ``(n_steps, n)``."""
    samples = []
    world.reset(np.random.default_rng(0))
    sound = world.sound.sources[name].sound
    original = sound.emit
    sound.emit = lambda n: samples.append(original(n)) or samples[-1]
    for step in range(n_steps):
        act(step)
        world.step()
    sound.emit = original
    return np.array(samples)


@pytest.fixture
def dropped():
    def drop(height_m, n_steps=40, **impacts):
        world = world_with(ball(height_m), **impacts)
        world.freeze()
        heard = emitted(world, "ball.impact", n_steps)
        again = emitted(world, "ball.impact", n_steps)
        world.close()
        assert heard.tobytes() == again.tobytes()
        return heard

    return drop


def test_a_falling_ball_is_heard_when_it_lands_and_not_before_or_when_it_rests(dropped):
    heard = dropped(0.6, n_steps=100)
    falls_s = np.sqrt(2.0 * 0.5 / 9.81)
    first = np.flatnonzero(heard.any(axis=1))[0]
    assert first == pytest.approx(falls_s / 0.04, abs=1.0)
    assert not heard[-20:].any()


@pytest.mark.parametrize("height_m", [0.4, 0.45, 0.5, 0.55, 0.6])
def test_an_impact_begins_in_the_physics_step_in_which_it_happens(dropped, height_m):
    heard, clock = dropped(height_m), ClockCfg()
    first_s = np.flatnonzero(heard.ravel())[0] * clock.step_s / heard.shape[1]
    falls_s = math.sqrt(2.0 * (height_m - 0.1) / 9.81)
    assert first_s == pytest.approx(falls_s, abs=1.5 * clock.substep_s)


def test_energy_grows_with_the_square_of_the_impulse(dropped):
    """Twice the speed of impact: four times the energy."""
    energies = []
    for height in (0.1 + 0.2, 0.1 + 0.8):
        heard = dropped(height)
        first = np.flatnonzero(heard.any(axis=1))[0]
        energies.append((heard[first : first + 2].astype(float) ** 2).sum())
    assert energies[1] / energies[0] == pytest.approx(4.0, rel=0.2)


def test_things_at_rest_and_rolling_are_silent():
    world = world_with(ball(0.1), rod())
    world.freeze()

    def roll(step):
        if step == 5:
            world.prop("ball").set_velocity((1, 0, 0), (0, 10, 0))

    assert not emitted(world, "ball.impact", 30, roll).any()
    world.close()


def stacked(*masses_kg, lowest_m=0.0):
    """Boxes of 0.2 m on each other, the first one lowest, all but it at rest."""
    return [
        PropCfg(
            f"box_{number}",
            PropShape.box,
            [0.2, 0.2, 0.2],
            (0.0, 0.0, 0.1 + 0.2 * number + (lowest_m if number else 0.0)),
            mass_kg=mass_kg,
            restitution=0.0,
        )
        for number, mass_kg in enumerate(masses_kg)
    ]


@pytest.mark.parametrize("masses_kg", [(1.0, 1.0, 1.0), (0.1, 1.0)])
def test_stacks_at_rest_are_silent(masses_kg):
    """The lowest box carries the weight of all others, and no velocity changes."""
    for number in range(len(masses_kg)):
        world = world_with(*stacked(*masses_kg))
        world.freeze()
        assert not emitted(world, f"box_{number}.impact", 40).any()
        world.close()


def test_a_heavy_box_that_falls_on_a_light_one_is_heard():
    """The light one lies on the floor, so that its velocity hardly changes."""
    world = world_with(*stacked(0.1, 1.0, lowest_m=0.2))
    world.freeze()
    for number in range(2):
        assert emitted(world, f"box_{number}.impact", 20).any()
    world.close()


def test_without_the_option_there_are_no_sources():
    world = world_with(ball(0.5), present=False)
    assert not world.sound.sources
    world.close()


def test_a_preset_of_hearing_turns_them_on_in_any_playground():
    plain, loud = (
        compose(["+task=KickTheBall", f"senses/audio={preset}"])
        for preset in ("hrtf", "hrtf_impacts")
    )
    assert not plain.playground.impacts.present
    assert loud.playground.impacts.present
    assert loud.senses.audio == plain.senses.audio
    assert replace(loud.playground, impacts=ImpactCfg()) == plain.playground


def test_material_and_size_determine_pitch_and_decay():
    wood, metal, longer = (
        prop_modes(rod()),
        prop_modes(rod(Material.metal)),
        prop_modes(rod(length=0.8)),
    )
    # Euler & Bernoulli, free ends: 1.028 h / L^2 sqrt(E / rho)
    theory = 1.028 * 0.02 / 0.4**2 * np.sqrt(1e10 / 600.0)
    assert wood.frequencies_hz[0] == pytest.approx(theory, rel=1e-3)
    assert wood.frequencies_hz[1] / wood.frequencies_hz[0] == pytest.approx(2.757, abs=1e-3)
    assert longer.frequencies_hz[0] == pytest.approx(wood.frequencies_hz[0] / 4.0)
    assert metal.decay_per_s[0] < 0.2 * wood.decay_per_s[0]


@pytest.mark.parametrize("lines", [2, 3, 4])
def test_spheres_ring_at_the_roots_of_the_frequency_equation(lines):
    """Eringen & Suhubi 1975, section 8.14, Poisson's ratio 0.3: the sign changes at the root."""

    def determinant(eta, n=lines, ratio=0.3):
        xi = eta * math.sqrt((1.0 - 2.0 * ratio) / (2.0 - 2.0 * ratio))
        j = spherical_jn
        radial = (n * n - n - eta**2 / 2) * j(n, xi) + 2 * xi * j(n + 1, xi)
        radial_shear = n * (n + 1) * ((n - 1) * j(n, eta) - eta * j(n + 1, eta))
        tangential = (n - 1) * j(n, xi) - xi * j(n + 1, xi)
        tangential_shear = (n * n - 1 - eta**2 / 2) * j(n, eta) + eta * j(n + 1, eta)
        return radial * tangential_shear - radial_shear * tangential

    root = SPHERE_ROOTS[lines - 2]
    assert determinant(root - 0.001) * determinant(root + 0.001) < 0.0


def test_a_goal_rings_as_its_bar_and_clicks_as_its_volume():
    goal = PropCfg("goal", PropShape.goal, [1.5, 1.0, 0.03], mass_kg=3.0)
    bar = PropCfg("bar", PropShape.cylinder, [0.03, 1.5], mass_kg=1.0)
    rings, clicks = prop_modes(goal).frequencies_hz[:-1], prop_modes(goal).frequencies_hz[-1]
    np.testing.assert_allclose(rings, prop_modes(bar).frequencies_hz[:-1])
    volume = math.pi * 0.03**2 * (1.5 + 2.0 * 1.0)
    radius_m = (volume / (4.0 / 3.0 * math.pi)) ** (1.0 / 3.0)
    assert clicks == pytest.approx(SPEED_OF_SOUND_MPS / (2.0 * math.pi * radius_m), rel=0.01)


def test_a_walker_is_heard_when_it_walks_and_silent_when_it_stands():
    world = world_with()
    walker = Walker("child", WalkerCfg(), world)
    world.freeze()

    def walk(step):
        walker.walk(0.0 if step >= 50 else 1.0, 0.0)

    heard = emitted(world, "child.steps", 100, walk)
    world.close()
    steps = np.flatnonzero(np.abs(heard[:50]).max(axis=1) > 0.01)
    assert len(steps) >= 8  # a foot lands every 0.2 m
    assert not heard[-20:].any()


@pytest.mark.parametrize("rate_hz", [5, 10, 25, 98])
def test_feet_land_at_the_same_times_at_every_control_rate(rate_hz):
    """Also if several of them land in one agent step."""
    clock = ClockCfg(control_rate_hz=rate_hz, substeps=max(1, 50 // rate_hz))
    world = World(PlaygroundCfg("test", impacts=ImpactCfg(present=True)), clock=clock)
    walker, struck = Walker("child", WalkerCfg(), world), []
    world.freeze()
    world.reset(np.random.default_rng(0))
    walker.place((0.0, 0.0, 0.0))
    board = world.sound.sources["child.steps"].sound
    for step in range(4 * rate_hz):
        board.strike = lambda _, delay, step=step: struck.append((step, delay))
        walker.walk(0.7, 0.0)
        world.step()
    samples = np.array([world.sound.step_samples * step + delay for step, delay in struck])
    apart_s = np.diff(samples[samples > 3 * 22_050]) / 22_050
    assert len(apart_s) >= 2
    np.testing.assert_allclose(apart_s, 0.2 / 0.7, atol=2e-4)


def test_footsteps_sound_at_the_floor_where_the_walker_stands():
    world = world_with()
    walker = Walker("child", WalkerCfg(), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    steps = world.sound.sources["child.steps"]
    walker.walk(1.0, 0.0)
    world.step()
    np.testing.assert_allclose(steps.position, (0.04, 0.0, 0.03), atol=1e-9)
    before = steps.teleports
    walker.place((1.0, 2.0, 0.0))
    np.testing.assert_allclose(steps.position, (1.0, 2.0, 0.03), atol=1e-9)
    assert steps.teleports == before + 1
    world.close()


@pytest.mark.parametrize("wrong", [{"gain_per_ns": 0.0}, {"min_speed_mps": float("nan")}])
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match=f"impacts.{next(iter(wrong))}"):
        ImpactCfg(**wrong)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        (PropShape.pyramid, [0.1, 0.1, 0.1]),
        (PropShape.sector, [0.1, 0.04]),
        (PropShape.doll, [0.2]),
    ],
)
def test_polyhedra_and_compounds_sound_when_they_land(shape, size):
    thing = PropCfg("thing", shape, size, (0.0, 0.0, 0.5), mass_kg=0.2)
    world = world_with(thing)
    world.freeze()
    heard = emitted(world, "thing.impact", 25)
    world.close()
    assert not heard[:5].any()
    assert np.abs(heard).max() > 0.0
    pitches = prop_modes(thing).frequencies_hz
    small = prop_modes(PropCfg("thing", shape, [0.5 * edge for edge in size])).frequencies_hz
    np.testing.assert_allclose(small, 2.0 * pitches, rtol=1e-6)


def test_a_box_as_a_compound_has_the_modes_of_a_box():
    part = PartCfg(PropShape.box, [0.4, 0.05, 0.02])
    one = prop_modes(PropCfg("rod", PropShape.compound, parts=[part]))
    other = prop_modes(rod())
    np.testing.assert_allclose(one.frequencies_hz, other.frequencies_hz, rtol=1e-9)


@pytest.mark.parametrize("substeps", [2, 5, 20])
def test_strikes_add_up_to_the_change_of_momentum(substeps):
    """A box that falls flat hits the floor with four corners, in several physics steps."""
    size, mass_kg = [0.2, 0.2, 0.2], 0.5
    box = PropCfg("box", PropShape.box, size, (0.0, 0.0, 0.6), mass_kg=mass_kg, restitution=0.3)
    playground = PlaygroundCfg("test", props=[box], impacts=ImpactCfg(present=True))
    world = World(playground, clock=ClockCfg(substeps=substeps))
    world.freeze()
    world.reset(np.random.default_rng(0))
    prop, strikes, speeds = world.prop("box"), [], []
    struck = world.sound.sources["box.impact"].sound
    struck.strike = lambda impulse_ns, delay: strikes.append(impulse_ns)
    world.after_substep.append(lambda: speeds.append(prop.velocity[2]))
    for _ in range(11):  # it falls for 0.32 s and hits again after 0.5 s
        world.step()
    lowest, highest = np.argmin(speeds), len(speeds) - 1 - np.argmax(speeds[::-1])
    hit_s = (highest - lowest) * world.clock.substep_s
    impulse_ns = mass_kg * (speeds[highest] - speeds[lowest] + 9.81 * hit_s)
    assert sum(strikes) == pytest.approx(impulse_ns, rel=0.1)


LEAF_M = (0.04, 0.9, 2.0)


def leaf(**joint):
    """A hinged leaf without friction, half open."""
    hinge = JointCfg(anchor_m=(0.0, -LEAF_M[1] / 2.0, 0.0), friction=0.0, opening=0.5, **joint)
    place = (1.0, 0.0, 1.05)
    return PropCfg("leaf", PropShape.box, list(LEAF_M), place, mass_kg=3.0, joint=hinge)


def test_the_stop_of_a_hinge_takes_its_angular_momentum_and_that_of_a_slide_its_momentum():
    """A thin leaf has a moment of inertia m w^2 / 3 about its edge: m w / 3 at the other one."""
    thickness, width, _ = LEAF_M
    hinged = joint_stop(leaf())
    assert hinged.reach == pytest.approx(math.hypot(width, thickness / 2.0))
    moment = 3.0 * (width**2 + thickness**2 / 4.0) / 3.0
    assert hinged.impulse * hinged.reach == pytest.approx(moment)
    sliding = joint_stop(leaf(kind=JointKind.slide))
    assert (sliding.reach, sliding.impulse) == (1.0, 3.0)


def strikes(cfg, act):
    """The (step, impulse) of each strike of a leaf within 40 steps."""
    world = world_with(cfg)
    world.freeze()
    prop, struck, start = world.prop("leaf"), [], world.step_count
    prop.impact.sound.strike = lambda impulse, delay: struck.append(
        (world.step_count - start, impulse)
    )
    world.reset(np.random.default_rng(0))
    act(prop, world.client)
    for _ in range(40):
        world.step()
    opening = prop.opening
    world.close()
    return struck, opening


def push_at(rate):
    """Give the joint a speed, as a push does."""

    def push(prop, client):
        coordinate = prop.opening * prop.joint.cfg.range
        client.resetJointState(prop.body_id, prop.link, coordinate, rate)

    return push


@pytest.mark.parametrize("rate", [1.2, -1.2])
def test_a_leaf_is_struck_once_when_it_meets_an_end_of_its_range(rate):
    ((step, impulse),), opening = strikes(leaf(), push_at(rate))
    assert opening == (1.0 if rate > 0.0 else 0.0)
    assert step == pytest.approx(math.radians(45.0) / 1.2 / 0.04, abs=1.0)
    assert impulse == pytest.approx(1.2 * joint_stop(leaf()).impulse, rel=1e-6)


def test_what_is_closed_slowly_or_stopped_by_friction_or_locked_is_silent():
    assert strikes(leaf(range_deg=4.0), push_at(0.1)) == ([], 1.0)
    braked = replace(leaf().joint, friction=30.0)
    assert strikes(replace(leaf(), joint=braked), push_at(1.2))[0] == []
    locked = replace(leaf().joint, lock=LockCfg())
    assert strikes(replace(leaf(), joint=locked), push_at(1.2)) == ([], 0.5)


def test_a_drawer_that_its_motor_opens_is_heard_at_the_end_of_its_slide():
    drawer = leaf(kind=JointKind.slide, axis=(0.0, 1.0, 0.0), range_m=0.3, open_s=1.0)
    ((step, impulse),), opening = strikes(drawer, lambda prop, client: prop.open())
    assert opening == 1.0
    assert step == pytest.approx(0.5 / 0.04, abs=1.0)
    assert impulse == pytest.approx(3.0 * 0.3, rel=0.01)


def test_the_stop_of_a_leaf_is_heard_from_the_leaf():
    world = world_with(leaf())
    world.freeze()
    prop = world.prop("leaf")

    def push(step):
        if step == 0:
            push_at(1.2)(prop, world.client)

    (first, *_) = np.flatnonzero(emitted(world, "leaf.impact", 40, push).any(axis=1))
    assert first == pytest.approx(math.radians(45.0) / 1.2 / 0.04, abs=1.0)
    np.testing.assert_allclose(world.sound.sources["leaf.impact"].position, prop.position)
    world.close()
