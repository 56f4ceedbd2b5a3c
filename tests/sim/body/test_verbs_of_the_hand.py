"""Grabbing, releasing, kicking and pressing, and what is refused."""

import math

import numpy as np
import pytest
from refusals import naming
from verbs import begin, do, seeing, toy
from walking import STEP_S, ball, box, empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.walker import WalkCommand, WalkerCfg
from veca_marl.sim.hearing import AudioCfg, AudioQuality, AudioSense
from veca_marl.sim.physics.props.toys import fraction_piece, key
from veca_marl.sim.sound import SoundCfg, SoundKind


def centre_of_mass(prop):
    return prop.position + prop.rotation @ prop.centre_of_mass


def test_a_grabbed_prop_follows_the_hand_and_falls_when_released():
    world = empty_world(toy())
    walker = seeing(world)
    begin(world)
    prop = world.prop("toy")
    assert do(world, walker, "grab")
    assert walker.applied_verb == ("grab", prop)
    assert (walker.held, prop.holder) == (prop, "walker")
    for _ in range(20):
        do(world, walker, "none", forward=1.0, turn=0.5)
        palm = walker.palms()[1]
        assert np.linalg.norm(prop.position - palm) == pytest.approx(0.048, abs=0.003)
    assert walker.interactable_object() is None  # what the hand holds is no object of a verb
    assert do(world, walker, "release")
    assert (walker.held, prop.holder) == (None, None)
    let_pass(world, 0.6)
    assert prop.position[2] == pytest.approx(0.05, abs=0.01)


def test_a_sounding_prop_is_grabbed_without_a_doppler_sweep():
    """The grabbed prop appears at the hand; the pitch of its tone stays."""
    tone = SoundCfg(SoundKind.tone, frequency_hz=1000.0)
    far = toy(position=(1.4, 0.0, 0.05), sound=tone)
    world = empty_world(far)
    walker = seeing(world)
    ears = AudioSense(AudioCfg(quality=AudioQuality.mono, waveform=True), walker, world)
    begin(world)
    ears.reset()
    for _ in range(5):
        world.step()
        ears.read()
    assert walker.grab(world.prop("toy"))
    world.step()
    heard = ears.read()["waveform"][0]
    crossings = np.flatnonzero((heard[:-1] < 0.0) & (heard[1:] >= 0.0))
    pitch_hz = world.sound.sample_rate_hz / np.diff(crossings)
    assert np.median(pitch_hz) == pytest.approx(1000.0, rel=0.03)
    assert pitch_hz.max() < 1070.0


def test_a_held_prop_does_not_move_its_holder_and_stays_before_walls():
    world = empty_world(toy(), wall(position=(1.0, 0.0, 0.0)))
    free = empty_world(wall(position=(1.0, 0.0, 0.0)))
    alone = walker_in(free)
    walker = seeing(world)
    begin(world)
    do(world, walker, "grab")
    free.step()
    for turn in [0.0] * 40 + [1.0] * 40:
        do(world, walker, "none", forward=1.0, turn=turn)
        alone.act(alone.encode((1.0, turn)))
        free.step()
        assert world.prop("toy").bounds()[1][0] < 0.96
    np.testing.assert_array_equal(walker.position[:2], alone.position[:2])
    hand_mps = world.prop("toy").velocity
    do(world, walker, "release")
    # it keeps the velocity of the hand, falls, and is not expelled from the wall
    assert np.linalg.norm(world.prop("toy").velocity - hand_mps) < 0.5


@pytest.mark.parametrize("fraction", [0.5, 0.125])
def test_a_held_prop_has_the_velocity_with_which_it_moves(fraction):
    """While the walker turns, the hand moves on a circle: v + omega x r at the centre of mass."""
    world = empty_world(fraction_piece("piece", fraction, (0.4, 0.0)))
    walker = walker_in(world)
    piece = world.prop("piece")
    assert walker.grab(piece)
    walker.walk(0.7, 1.5)
    before = after = centre_of_mass(piece)
    for _ in range(5):
        world.step()
        before, after = after, centre_of_mass(piece)
    assert np.linalg.norm(piece.velocity - walker.velocity) > 0.2
    # the mean velocity over an agent step is that in its middle, and shorter by the chord
    arc_rad = 1.5 * STEP_S
    c, s = math.cos(arc_rad / 2), math.sin(arc_rad / 2)
    mean = (after - before) / STEP_S
    now = np.array([c * mean[0] - s * mean[1], s * mean[0] + c * mean[1], 0.0])
    np.testing.assert_allclose(piece.velocity, now, atol=0.02)
    _, spin = world.client.getBaseVelocity(piece.body_id)
    assert spin[2] == pytest.approx(1.5)
    released = centre_of_mass(piece)
    assert walker.release()
    world.step()
    flown = (centre_of_mass(piece) - released)[:2] / STEP_S
    np.testing.assert_allclose(flown, piece.velocity[:2], atol=0.02)


@pytest.mark.parametrize("turn_radps", [2.1, -2.1])
@pytest.mark.parametrize(("fraction", "y"), [(0.5, 0.1), (0.125, -0.1), (0.125, 0.05)])
def test_a_prop_that_is_released_at_the_end_of_a_wall_is_not_thrown(fraction, y, turn_radps):
    """While the walker turns there, the prop is moved round the edge within one physics step."""
    world = empty_world(
        wall(position=(1.0, -3.0, 0.0)), fraction_piece("piece", fraction, (0.4, 0.0))
    )
    walker, piece = walker_in(world), world.prop("piece")
    world.freeze()
    fastest_mps = fastest = 0
    for steps in (75, None):
        world.reset(np.random.default_rng(0))
        walker.place((0.83, y, 0.0))
        assert walker.grab(piece)
        for step in range(steps or fastest):
            walker.walk(0.0, turn_radps)
            world.step()
            speed_mps = np.linalg.norm(piece.velocity)
            if speed_mps > fastest_mps:
                fastest_mps, fastest = speed_mps, step + 1
    assert fastest_mps < 2.1 * 0.5 + 1.0  # of a hand at 0.5 m, and of the arm
    released = piece.position
    assert walker.release()
    let_pass(world, 0.6)
    assert np.linalg.norm(piece.position - released) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["half", "quarter", "key", "cube"])
def test_a_prop_held_in_a_corner_stays_out_of_its_walls_and_falls_there(kind):
    thing = {
        "half": fraction_piece("thing", 0.5, (0.4, 0.0)),
        "quarter": fraction_piece("thing", 0.25, (0.4, 0.0)),
        "key": key("thing", (0.4, 0.0)),
        "cube": box("thing", (0.12, 0.12, 0.12), 0.3, (0.4, 0.0, 0.06)),
    }[kind]
    east, north = wall("east", position=(1.6, 0, 0)), wall("north", position=(0, 1.6, 0), yaw_deg=0)
    world = empty_world(east, north, thing)
    walker, held = walker_in(world), world.prop("thing")
    world.freeze()
    for seed in range(6):
        rng = np.random.default_rng(seed)
        world.reset(rng)
        walker.place((0.0, 0.0, 0.0))
        held.place(held.position, rng.uniform(-math.pi, math.pi))
        assert walker.grab(held)
        for step in range(80):
            walker.walk(0.9, rng.uniform(0.0, 0.5) if step < 50 else rng.uniform(-2.0, 2.0))
            world.step()
            overlaps = [
                -point.distance_m
                for one in ("east", "north")
                for point in world.client.getClosestPoints(
                    held.body_id, world.prop(one).body_id, 0.0
                )
            ]
            assert max(overlaps, default=0.0) < 0.01
        walker.walk(0.0, 0.0)
        assert walker.release()
        let_pass(world, 1.5)
        low, high = held.bounds()
        assert ((low + high)[:2] / 2.0 < 1.55).all()
        assert np.linalg.norm(held.velocity) < 0.5


@pytest.mark.parametrize("place", [(0.35, 0.1, 0.0), (0.25, -0.35, 0.0), (0.35, -0.25, 0.0)])
@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 270.0])
def test_a_held_prop_stays_out_of_another_walker(place, yaw_deg):
    world = empty_world(fraction_piece("piece", 0.5, (0.4, 0.0)))
    walker, other = walker_in(world), walker_in(world, "other", place)
    piece = world.prop("piece")
    piece.place((0.4, 0.0, piece.position[2]), math.radians(yaw_deg))
    assert walker.grab(piece)
    let_pass(world, 0.2)
    points = world.client.getClosestPoints(piece.body_id, other.body_id, 0.0)
    assert max((-point.distance_m for point in points), default=0.0) < 0.01


@pytest.mark.parametrize(
    "prop",
    [
        ball(position=(0.6, 0.0, 0.1)),
        ball(position=(0.6, 0.0, 0.1), mass_kg=8.0, interactions=["grab"]),
        box(position=(0.6, 0.0, 0.15), mass_kg=0.0, interactions=["grab"]),
        box(position=(0.6, 0.0, 0.15), interactions=["kick"]),
    ],
    ids=["undeclared", "heavy", "fixed", "another_verb"],
)
def test_a_verb_on_the_wrong_thing_changes_nothing(prop):
    world, untouched = empty_world(prop), empty_world(prop)
    walker, other = seeing(world), seeing(untouched)
    begin(world)
    begin(untouched)
    assert not do(world, walker, "grab")
    do(untouched, other, "none")
    np.testing.assert_array_equal(world.scene.positions, untouched.scene.positions)


@pytest.mark.parametrize("method", ["grab", "open", "close", "kick", "step_on"])
def test_a_method_has_no_effect_where_nothing_is_interactable(method):
    world = empty_world()
    walker = seeing(world)
    begin(world)
    assert walker.interactable_object() is None
    assert getattr(walker, method)(walker.interactable_object()) is False
    assert walker.held is None


def test_release_with_empty_hands_and_a_second_grab_are_refused():
    world = empty_world(toy(), toy("second", (0.7, 0.2, 0.05)))
    walker = seeing(world)
    begin(world)
    assert not do(world, walker, "release")
    assert do(world, walker, "grab")
    assert not do(world, walker, "grab")
    assert walker.held is world.prop("toy")


@pytest.mark.parametrize("order", [("near", "far"), ("far", "near")])
def test_of_two_that_grab_at_once_the_nearer_gets_it_and_keeps_it(order):
    places = {"near": ((0.0, 0.0, 0.0), 0.0), "far": ((1.6, 0.0, 0.0), 180.0)}
    world = empty_world(toy())
    walkers = {name: seeing(world, name, *places[name]) for name in order}
    begin(world)
    for name, walker in walkers.items():
        place, yaw_deg = places[name]
        walker.place(place, math.radians(yaw_deg))
    world.refresh()
    for walker in walkers.values():
        walker.act(walker.encode(WalkCommand(0.0, 0.0, verb="grab")))
    world.step()
    assert world.prop("toy").holder == "near"
    assert walkers["far"].verb_was_refused
    assert not do(world, walkers["far"], "grab")


def test_a_reset_releases_and_equal_actions_give_equal_bytes():
    world = empty_world(toy(), ball("other", position=(0.7, 0.3, 0.1)))
    walker = seeing(world)
    world.freeze()
    films = []
    for _ in range(3):
        world.reset(np.random.default_rng(0))
        assert walker.held is None
        assert world.prop("toy").holder is None
        world.refresh()
        film = []
        for verb in ["grab", *["none"] * 8, "release", *["none"] * 6, "kick", "grab", "none"]:
            do(world, walker, verb, forward=0.6, turn=0.3)
            film.append(world.scene.positions.tobytes())
        films.append(film)
    assert films[0] == films[1] == films[2]


@pytest.mark.parametrize("radius_m", [0.06, 0.1, 0.15, 0.2])
def test_a_ball_at_the_foot_is_kicked_though_it_is_below_the_view(radius_m):
    cfg = ball(radius_m=radius_m, position=(0.2 + radius_m, 0.0, radius_m), interactions=["kick"])
    world = empty_world(cfg)
    walker = seeing(world)
    begin(world)
    assert do(world, walker, "kick")
    assert world.prop("ball").velocity[0] > 1.0


def test_of_two_balls_at_the_foot_the_one_ahead_is_kicked():
    beside = ball("beside", position=(0.2, 0.2, 0.1), interactions=["kick"])
    ahead = ball("ahead", position=(0.3, -0.05, 0.1), interactions=["kick"])
    world = empty_world(beside, ahead)
    walker = seeing(world)
    begin(world)
    assert do(world, walker, "kick")
    assert np.linalg.norm(world.prop("ahead").velocity) > 1.0
    assert np.linalg.norm(world.prop("beside").velocity) < 0.1


def test_a_ball_that_does_not_declare_it_is_not_kicked_by_the_verb():
    world = empty_world(ball(position=(0.3, 0.0, 0.1)))
    walker = seeing(world)
    begin(world)
    assert not do(world, walker, "kick")


def test_unknown_verbs_are_refused_where_they_are_named():
    with pytest.raises(ValueError, match=naming("body.verbs", "'grap'", "grab")) as refusal:
        WalkerCfg(verbs=["grap"])
    assert str(refusal.value).count("grab") == 2  # as the nearest one and among all
    with pytest.raises(ValueError, match=naming("body.verbs=['grab', 'grab']")):
        WalkerCfg(verbs=["grab", "grab"])
    with pytest.raises(ValueError, match=naming("prop 'ball'", "interactions", "'throw'")):
        empty_world(ball(interactions=["throw"]))
    with pytest.raises(ValueError, match=naming("'grab'", "none", "body.verbs")):
        walker_in(empty_world()).encode(WalkCommand(0.0, 0.0, verb="grab"))


def test_pressing_moves_nothing_and_is_reported():
    world = empty_world(
        box("button", (0.1, 0.1, 0.1), 0.0, (0.6, 0.0, 0.05), interactions=["press"])
    )
    walker = seeing(world, extra_verbs=["press"])
    begin(world)
    before = world.prop("button").position
    assert do(world, walker, "press")
    assert walker.applied_verb == ("press", world.prop("button"))
    assert walker.info() == {"refused_verbs": 0.0}
    np.testing.assert_array_equal(world.prop("button").position, before)
    do(world, walker, "none")
    assert walker.applied_verb is None
    do(world, walker, "release")
    assert walker.info() == {"refused_verbs": 1.0}
