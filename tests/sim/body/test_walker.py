"""The walking body: motion, head, focus of the eyes, voice, and impossible arguments."""

import math

import numpy as np
import pytest
from refusals import naming
from walking import ball, empty_world, let_pass, walker_in, wall

from veca_marl.sim.body import MOUNTS
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.body.walker.actions import MOVES, WALK_ACTIONS, WalkActionKind
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.physics import ClockCfg
from veca_marl.sim.senses import SensesCfg, make_senses
from veca_marl.sim.vision import is_visible


def bearing_deg(pose):
    forward = pose.rotation[:, 0]
    return math.degrees(math.atan2(forward[1], forward[0]))


def down_deg(pose):
    return math.degrees(math.asin(-pose.rotation[2, 0]))


# ---- motion


@pytest.mark.parametrize("speed", [1.0, 0.25, -0.8])
def test_it_walks_at_the_commanded_speed(speed):
    world = empty_world()
    walker = walker_in(world, yaw_deg=30.0)
    walker.walk(speed, 0.0)
    let_pass(world, 2.0)
    distance = 2.0 * speed * np.array([math.cos(math.pi / 6), math.sin(math.pi / 6), 0.0])
    np.testing.assert_allclose(walker.position[:2], distance[:2], atol=1e-9)
    np.testing.assert_allclose(walker.velocity, distance / 2.0, atol=1e-9)


@pytest.mark.parametrize("turn_degps", [90.0, -45.0])
def test_it_turns_at_the_commanded_speed_and_left_is_positive(turn_degps):
    world = empty_world()
    walker = walker_in(world)
    walker.walk(0.0, math.radians(turn_degps))
    let_pass(world, 1.0)
    assert bearing_deg(walker.bone("pelvis")) == pytest.approx(turn_degps, abs=1e-9)
    np.testing.assert_allclose(walker.position[:2], 0.0, atol=1e-12)


def test_it_walks_in_a_circle():
    """Radius = speed / turn rate; after a full turn it is back at its start."""
    world = empty_world()
    walker = walker_in(world)
    walker.walk(1.0, 2.0 * math.pi / 4.0)
    let_pass(world, 2.0)
    across = np.linalg.norm(walker.position[:2])
    assert across == pytest.approx(2.0 * 4.0 / (2.0 * math.pi), rel=0.01)
    let_pass(world, 2.0)
    np.testing.assert_allclose(walker.position[:2], 0.0, atol=1e-6)


def walked(is_clear, monkeypatch):
    """Return a walk by random commands in a room with a wall and a ball, as a list of poses."""
    monkeypatch.setattr(Walker, "is_clear", property(is_clear))
    rng = np.random.default_rng(5)
    world = empty_world(wall(position=(0.7, 0.0, 0.0)), ball(position=(-0.5, 0.0, 0.1)))
    walker, poses = walker_in(world), []
    for _ in range(200):
        walker.walk(rng.uniform(-1.0, 1.0), rng.uniform(-2.0, 2.0))
        world.step()
        poses.append([*walker.position, walker.yaw_rad, *world.props["ball"].position])
    return poses


def test_a_step_in_the_open_is_that_of_its_physics_steps(monkeypatch):
    """A walker that can meet nothing walks through an agent step at once, to the same bytes."""
    free_steps, is_clear = [], Walker.is_clear.fget

    def notice(walker):
        free_steps.append(is_clear(walker))
        return free_steps[-1]

    at_once = walked(notice, monkeypatch)
    by_physics_steps = walked(lambda walker: False, monkeypatch)
    assert any(free_steps)
    assert not all(free_steps)
    assert at_once == by_physics_steps


def test_full_actions_are_the_configured_speeds():
    world = empty_world()
    walker = walker_in(world, walk_speed_mps=0.8, turn_speed_degps=50.0)
    walker.act({"move": np.array([1.0, -1.0], np.float32)})
    let_pass(world, 0.04)
    assert np.linalg.norm(walker.velocity) == pytest.approx(0.8, rel=1e-3)
    assert bearing_deg(walker.bone("pelvis")) == pytest.approx(-50.0 * 0.04)


def test_backward_is_slower():
    world = empty_world()
    walker = walker_in(world, walk_speed_mps=0.8, backward_share=0.25)
    walker.act({"move": np.array([-1.0, 0.0], np.float32)})
    let_pass(world, 0.04)
    np.testing.assert_allclose(walker.velocity, (-0.2, 0.0, 0.0), atol=1e-6)


def test_an_action_lasts_until_the_next():
    world = empty_world()
    walker = walker_in(world)
    walker.act({"move": np.array([1.0, 0.0], np.float32)})
    let_pass(world, 1.0)
    walker.act({"move": np.array([0.0, 0.0], np.float32)})
    let_pass(world, 1.0)
    assert walker.position[0] == pytest.approx(1.0)


@pytest.mark.parametrize("move", MOVES)
def test_discrete_moves_equal_continuous_ones(move):
    positions = []
    for kind in WalkActionKind:
        world = empty_world()
        walker = walker_in(world, action=kind)
        walker.act({"move": WALK_ACTIONS[kind].encode(*MOVES[move])})
        let_pass(world, 0.4)
        positions.append((*walker.position, walker.yaw_rad))
    assert positions[0] == positions[1]


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (WalkActionKind.continuous, np.array([np.nan, 0.0])),
        (WalkActionKind.continuous, np.array([0.0, np.inf])),
        (WalkActionKind.continuous, np.array([1.5, 0.0])),
        (WalkActionKind.continuous, np.array([0.0, -1.0001])),
        (WalkActionKind.continuous, np.array([0.0])),
        (WalkActionKind.continuous, np.array([[0.0, 0.0]])),
        (WalkActionKind.continuous, np.array(1)),
        (WalkActionKind.continuous, None),
        (WalkActionKind.discrete, np.array(7)),
        (WalkActionKind.discrete, np.array(-1)),
        (WalkActionKind.discrete, np.array(1.5)),
        (WalkActionKind.discrete, np.array(np.nan)),
        (WalkActionKind.discrete, np.array([1])),
        (WalkActionKind.discrete, np.array(True)),
    ],
)
def test_impossible_actions_are_refused_and_nothing_moves(kind, value):
    world = empty_world()
    walker = walker_in(world, action=kind)
    with pytest.raises(ValueError, match=naming("action", "'move'")):
        walker.act({"move": value})
    before = world.scene.positions.copy()
    let_pass(world, 0.04)
    np.testing.assert_array_equal(world.scene.positions[:, :2], before[:, :2])


# ---- head and eyes


def test_positive_head_angles_are_down_and_right():
    world = empty_world()
    walker = walker_in(world, head_pitch_deg=0.0)
    walker.rotate_up_down_head(20.0)
    let_pass(world, 0.04)
    assert down_deg(walker.mount("head")) == pytest.approx(20.0)
    walker.rotate_up_down_head(-50.0)
    let_pass(world, 0.04)
    assert down_deg(walker.mount("head")) == pytest.approx(-30.0)
    walker.rotate_up_down_head(30.0)
    walker.rotate_left_right_head(40.0)
    let_pass(world, 0.04)
    assert bearing_deg(walker.mount("head")) == pytest.approx(-40.0)


def test_head_angles_are_clipped_to_the_range_of_the_neck():
    world = empty_world()
    walker = walker_in(world)
    for turn, reached, limit in (
        (walker.rotate_up_down_head, down_deg, 80.0),
        (walker.rotate_up_down_head, down_deg, -70.0),
    ):
        turn(math.copysign(500.0, limit))
        let_pass(world, 0.04)
        assert reached(walker.mount("head")) == pytest.approx(limit)
    walker.place((0.0, 0.0, 0.0))
    walker.rotate_up_down_head(-12.0)
    walker.rotate_left_right_head(500.0)
    let_pass(world, 0.04)
    assert bearing_deg(walker.mount("head")) == pytest.approx(-110.0)
    walker.rotate_left_right_head(-500.0)
    let_pass(world, 0.04)
    assert bearing_deg(walker.mount("head")) == pytest.approx(110.0)


def attitude_deg(walker):
    """Bearing, pitch and roll of the head; its pose is a view that the next step overwrites."""
    head = walker.mount("head")
    return bearing_deg(head), down_deg(head), math.degrees(math.asin(head.rotation[2, 1]))


@pytest.mark.parametrize("crawls", [False, True])
@pytest.mark.parametrize("turned_deg", [-40.0, 20.0, 40.0, 80.0])
def test_a_turned_head_nods_about_its_own_axis(turned_deg, crawls):
    """Heading and roll stay; on all fours the turn may be smaller than commanded."""
    world = empty_world()
    walker = walker_in(world, verbs=["crawl"])
    let_pass(world, 0.04)
    if crawls:
        assert walker.crawl()
    walker.rotate_left_right_head(turned_deg)
    let_pass(world, 0.04)
    if not crawls or abs(turned_deg) <= 40.0:
        assert attitude_deg(walker)[0] == pytest.approx(-turned_deg)
    for nod_deg in (20.0, -20.0):
        bearing, before_deg, _ = attitude_deg(walker)
        walker.rotate_up_down_head(nod_deg)
        let_pass(world, 0.04)
        after, down, roll = attitude_deg(walker)
        assert down - before_deg == pytest.approx(nod_deg)
        assert after == pytest.approx(bearing)
        assert roll == pytest.approx(0.0, abs=1e-4)


def test_turns_and_nods_in_small_steps_end_within_the_range_of_the_neck():
    """The nearest attitude to the commands is level, and nods back reverse nods."""
    world = empty_world()
    walker = walker_in(world)
    for _ in range(13):
        walker.rotate_left_right_head(9.0)
        walker.rotate_up_down_head(6.0)
    let_pass(world, 0.04)
    bearing, down, roll = attitude_deg(walker)
    assert roll == pytest.approx(0.0, abs=1e-4)
    assert bearing < -60.0
    assert down > 40.0
    walker.rotate_up_down_head(-30.0)
    let_pass(world, 0.04)
    assert down - attitude_deg(walker)[1] == pytest.approx(30.0)


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_head_angles_must_be_finite(wrong):
    walker = walker_in(empty_world())
    with pytest.raises(ValueError, match=naming("head", wrong)):
        walker.rotate_up_down_head(wrong)
    with pytest.raises(ValueError, match=naming("head", wrong)):
        walker.rotate_left_right_head(wrong)


def test_focal_distances_must_be_positive():
    walker = walker_in(empty_world())
    walker.adjust_focal_length(0.4)
    assert walker.focal_distance_m == 0.4
    walker.adjust_focal_length(math.inf)
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=naming("focal distance", wrong)):
            walker.adjust_focal_length(wrong)


def test_the_organs_have_anatomical_positions():
    walker = walker_in(empty_world(), head_pitch_deg=0.0)
    at = {name: walker.mount(name).position for name in MOUNTS}
    assert at["eye_left"][1] > 0.0 > at["eye_right"][1]
    assert at["ear_left"][1] > at["eye_left"][1]
    assert at["mouth"][2] < at["eye_left"][2]
    assert at["mouth"][0] > at["ear_left"][0]
    middle = (at["ear_left"] + at["ear_right"]) / 2.0
    np.testing.assert_allclose(middle, at["head"], atol=1e-12)
    with pytest.raises(KeyError, match=naming("'nose'", "mouth")):
        walker.mount("nose")


def test_objects_in_front_of_the_eyes_are_visible():
    world = empty_world(ball(), ball("behind", position=(-1.0, 0.0, 0.1)))
    walker, other = walker_in(world), walker_in(world, "other", place=(1.5, 0.3, 0.0))
    world.refresh()
    assert is_visible(world.scene, walker, world.prop("ball"))
    assert is_visible(world.scene, walker, world.prop("ball"), ["eye_right"])
    assert is_visible(world.scene, walker, other)
    assert not is_visible(world.scene, walker, world.prop("behind"))
    world.prop("ball").place((1.0, 0.0, -0.5))
    world.refresh()
    assert not is_visible(world.scene, walker, world.prop("ball"))
    with pytest.raises(ValueError, match=naming("'third'", "eye_left")):
        is_visible(world.scene, walker, other, ["third"])


def test_a_wall_occludes():
    world = empty_world(ball(position=(2.0, 0.0, 0.1)), wall(position=(1.0, 0.0, 0.0)))
    walker = walker_in(world)
    world.refresh()
    assert not is_visible(world.scene, walker, world.prop("ball"))


# ---- voice


def hears(world, walker):
    sense = AudioSense(AudioCfg(waveform=True), walker, world)
    return lambda: np.sqrt(np.mean(sense.read()["waveform"] ** 2))


def test_a_voice_is_loudest_for_the_speaker():
    world = empty_world()
    speaker, listener = walker_in(world), walker_in(world, "listener", place=(2.0, 0.0, 0.0))
    own, others = hears(world, speaker), hears(world, listener)
    tone = np.sin(2.0 * np.pi * 300.0 * np.arange(8820) / 22_050).astype(np.float32)
    speaker.make_sound(tone)
    heard = []
    for _ in range(10):
        world.step()
        heard.append((own(), others()))
    loudest = np.max(heard, axis=0)
    assert loudest[0] > 3.0 * loudest[1] > 0.0


def test_a_silent_world_is_silent():
    world = empty_world()
    listen = hears(world, walker_in(world))
    world.step()
    assert listen() == 0.0


def test_a_reset_silences_the_voice():
    world = empty_world()
    walker = walker_in(world)
    listen = hears(world, walker)
    world.freeze()
    walker.make_sound(np.ones(22_050, np.float32))
    world.reset(np.random.default_rng(0))
    world.step()
    assert listen() == 0.0


# ---- impossible arguments


@pytest.mark.parametrize("number", ["walk_speed_mps", "radius_m", "kick_reach_m", "push_limit_kg"])
@pytest.mark.parametrize("wrong", [-1.0, math.inf])
def test_impossible_parameters_are_refused(number, wrong):
    with pytest.raises(ValueError, match=number):
        WalkerCfg(**{number: wrong})


def test_an_unknown_kind_of_action_is_refused_with_the_choices():
    with pytest.raises(ValueError, match=naming("body.action='fly'", "continuous", "discrete")):
        WalkerCfg(action="fly")


def test_a_capsule_must_be_higher_than_wide():
    with pytest.raises(ValueError, match="capsule_height_m"):
        WalkerCfg(radius_m=0.5, capsule_height_m=0.6)
    with pytest.raises(ValueError, match="radius_m"):
        WalkerCfg(radius_m=0.0)


@pytest.mark.parametrize("wrong", [(np.nan, 0.0), (0.0, np.inf)])
def test_speeds_must_be_finite(wrong):
    with pytest.raises(ValueError, match=naming(f"{wrong[0]} m/s", f"{wrong[1]} rad/s")):
        walker_in(empty_world()).walk(*wrong)


def test_places_must_be_finite():
    walker = walker_in(empty_world())
    for wrong in (((np.nan, 0.0, 0.0), 0.0), ((0.0, 0.0, 0.0), np.nan)):
        with pytest.raises(ValueError, match=naming(*wrong)):
            walker.place(*wrong)
    np.testing.assert_allclose(walker.position[:2], 0.0)


def test_unknown_senses_are_refused_with_the_choices():
    world = empty_world()
    walker = walker_in(world)
    with pytest.raises(ValueError, match=r"'smell'.*audio.*vision"):
        make_senses(walker, ("vision", "smell"), SensesCfg(), world)


@pytest.mark.parametrize(("rate_hz", "substeps"), [(10, 1), (25, 1), (25, 10)])
def test_the_path_of_a_turning_walker_is_an_arc_at_every_clock(rate_hz, substeps):
    """Half a circle at 0.4 m/s and 90 degrees/s: its diameter is 2 * 0.4 / (pi / 2) m."""
    world = empty_world(clock=ClockCfg(rate_hz, substeps))
    walker = walker_in(world)
    walker.walk(0.4, math.pi / 2.0)
    for _ in range(2 * rate_hz):
        world.step()
    assert walker.position[:2] == pytest.approx([0.0, 1.6 / math.pi], abs=1e-9)
    walker.walk(-0.4, -math.pi / 2.0)
    for _ in range(2 * rate_hz):
        world.step()
    assert walker.position[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
