"""Bodies of several ages in a world: gait, capsule, organs, voice, joints."""

import math

import numpy as np
import pytest
from composed import compose
from humanoids import random_torques, remove_gravity
from refusals import naming
from walking import ball, empty_world, let_pass, walker_in

from veca_marl.envs.core.game import Game
from veca_marl.sim.body import VoiceKind
from veca_marl.sim.body.anatomy import Soles, growth_at, load_skeleton
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.body.walker.gait import Gait
from veca_marl.sim.hearing import AudioCfg, AudioQuality, AudioSense
from veca_marl.sim.sound import CALLS, Call, call_waveform

AGES = (4, 8, 18)
WALKS = [(0.8, 0.0), (0.3, 0.0), (-0.8, 0.0), (0.0, 2.0), (0.8, 1.5)]


@pytest.fixture(params=AGES)
def age(request):
    return float(request.param)


# ---- walkers


def test_lengths_and_speeds_of_a_walker_follow_its_body(age):
    growth, table = growth_at(age), WalkerCfg()
    cfg = walker_in(empty_world(), age_months=age).cfg
    assert cfg.kick_reach_m == pytest.approx(table.kick_reach_m * growth.leg)
    assert cfg.capsule_height_m == pytest.approx(table.capsule_height_m * growth.size)
    assert cfg.walk_speed_mps == pytest.approx(table.walk_speed_mps * math.sqrt(growth.leg))
    assert cfg.turn_speed_degps == table.turn_speed_degps
    assert cfg.push_limit_kg == pytest.approx(
        table.push_limit_kg * load_skeleton(growth).mass_kg / load_skeleton().mass_kg
    )


def test_a_walker_keeps_its_own_numbers_in_proportion(age):
    own = walker_in(empty_world(), age_months=age, kick_reach_m=0.3)
    assert own.cfg.kick_reach_m == pytest.approx(0.3 * growth_at(age).leg)


def test_eyes_are_at_the_height_of_the_body(age):
    here, table = (walker_in(empty_world(), age_months=months) for months in (age, None))
    growth, eyes = growth_at(age), []
    for walker in (here, table):
        left, right = (walker.mount(f"eye_{side}").position for side in ("left", "right"))
        eyes.append(left[2])
        apart_m = np.linalg.norm(left - right)
        assert apart_m == pytest.approx(0.045 * walker.growth.head_size)
    assert eyes[0] / eyes[1] == pytest.approx(growth.size, abs=0.02)
    assert 0.85 * growth.height_m < eyes[0] < 0.95 * growth.height_m


def test_the_capsule_reaches_into_the_head_and_not_above_it(age):
    walker = walker_in(empty_world(), age_months=age)
    chin_m = walker.bone("head").position[2]
    assert chin_m < walker.cfg.capsule_height_m < walker.growth.height_m


@pytest.mark.parametrize("walk", WALKS)
def test_the_lowest_sole_is_on_the_floor(age, walk):
    world = empty_world()
    walker = walker_in(world, age_months=age)
    soles = Soles(walker.skeleton)
    walker.walk(*walk)
    for _ in range(40):
        world.step()
        lowest_m = soles.lowest_m(walker._drawn.positions, walker._drawn.rotations)
        assert lowest_m == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("walk", WALKS)
def test_joint_angles_are_within_the_limits_before_clipping(age, walk):
    skeleton, slack = load_skeleton(growth_at(age)), math.radians(1.0)
    gait = Gait(skeleton)
    gait._low, gait._high = np.full(82, -np.inf), np.full(82, np.inf)
    gait._neck.turn = lambda *_, **__: None
    for _ in range(60):
        gait.advance(*walk, 0.04)
        for angle, joint in zip(gait.pose(0.0, 0.0), skeleton.joints, strict=True):
            assert joint.low_rad - slack <= angle <= joint.high_rad + slack, joint


@pytest.mark.parametrize("speed", [0.8, 0.4, -0.6])
def test_the_foot_in_stance_does_not_slip(age, speed):
    world = empty_world()
    walker = walker_in(world, age_months=age)
    walker.walk(speed, 0.0)
    let_pass(world, 1.0)
    feet, places = [walker.skeleton.bone(f"{side}_foot") for side in "lr"], []
    for _ in range(50):
        world.step()
        places.append(walker._drawn.positions[feet].copy())
    slid = np.linalg.norm(np.diff(places, axis=0), axis=2).min(axis=1) / 0.04
    assert np.median(slid) < 0.02 * abs(speed)


def test_a_smaller_body_kicks_what_a_smaller_leg_reaches():
    reaches = []
    for months in (4.0, None):
        world = empty_world(ball(position=(0.32, 0.0, 0.1)))
        walker = walker_in(world, age_months=months)
        reaches.append(walker.can_kick(world.props["ball"]))
    assert reaches == [False, True]


def test_grown_walkers_crawl():
    world = empty_world()
    walker = walker_in(world, age_months=8.0, verbs=["crawl", "stand_up"])
    assert walker.crawl()
    let_pass(world, 0.2)
    assert walker.mount("head").position[2] < 0.7 * growth_at(8.0).height_m
    assert walker.stand_up()


# ---- voice and ears


def peak_hz(samples, rate_hz):
    magnitudes = np.abs(np.fft.rfft(samples))
    return np.fft.rfftfreq(len(samples), 1.0 / rate_hz)[magnitudes.argmax()]


def test_the_voice_of_a_smaller_body_is_higher(age):
    growth, rate_hz = growth_at(age), 22_050
    own = peak_hz(call_waveform(CALLS[Call.low].pitched(growth.pitch), rate_hz), rate_hz)
    assert own == pytest.approx(CALLS[Call.low].begin_hz / growth.size, abs=5.0)


def test_a_body_calls_with_its_own_voice(monkeypatch, age):
    said = []
    walker = walker_in(empty_world(), age_months=age, voice=VoiceKind.calls)
    monkeypatch.setattr(walker._voice, "say", said.append)
    walker.call(Call.low)
    assert peak_hz(said[0], 22_050) == pytest.approx(300.0 / walker.growth.size, abs=5.0)


@pytest.mark.parametrize("scale", [1.0, 0.733])
def test_ears_are_as_far_apart_as_the_head_is_wide(age, scale):
    apart = []
    for months in (age, None):
        world = empty_world()
        walker = walker_in(world, age_months=months)
        world.freeze()
        cfg = AudioCfg(quality=AudioQuality.stereo, head_scale=scale)
        left, right = AudioSense(cfg, walker, world)._listener._ears._receiver.ears
        apart.append(np.linalg.norm(np.subtract(left, right)))
    assert apart[0] / apart[1] == pytest.approx(growth_at(age).head_size)


def test_a_head_that_no_receiver_has_is_refused():
    world = empty_world()
    walker = walker_in(world, age_months=1.0)
    with pytest.raises(ValueError, match=naming("senses.audio.head_scale=0.5", "0.78 m")):
        AudioSense(AudioCfg(head_scale=0.5), walker, world)


# ---- joints


def humanoid_in(world, months, **numbers):
    return Humanoid("child", HumanoidCfg(age_months=months, **numbers), world)


@pytest.mark.parametrize("months", [1.0, *AGES, 36.0])
@pytest.mark.parametrize("detail", Detail)
def test_a_joint_level_body_has_the_mass_and_the_torques_of_its_age(months, detail):
    world = empty_world()
    body = humanoid_in(world, months, detail=detail)
    world.freeze()
    links = range(-1, world.client.getNumJoints(body.body_id))
    masses = [world.client.getDynamicsInfo(body.body_id, link).mass_kg for link in links]
    assert sum(masses) == pytest.approx(body.skeleton.mass_kg, rel=1e-6)
    torques = np.array([joint.torque_nm for joint in body.skeleton.joints])
    moving = body.articulation.moving
    np.testing.assert_allclose(body.joint_strengths_nm[moving], torques[moving], rtol=1e-6)


@pytest.mark.parametrize("months", [1.0, *AGES, 36.0])
@pytest.mark.parametrize("detail", Detail)
def test_a_joint_level_body_withstands_random_torques_within_its_limits(months, detail):
    world = empty_world()
    body = humanoid_in(world, months, detail=detail)
    world.freeze()
    world.reset(np.random.default_rng(0))
    body.place((0.0, 0.0, 0.0), 0.0, ON_BACK)
    low = np.array([joint.low_rad for joint in body.skeleton.joints])
    high = np.array([joint.high_rad for joint in body.skeleton.joints])
    for _ in random_torques(world, [body], 1.6):
        assert body.is_finite
        assert (body.joint_angles() >= low - 1e-6).all()
        assert (body.joint_angles() <= high + 1e-6).all()
        assert -0.05 < body.position[2] < 1.0


@pytest.mark.parametrize("months", [1.0, 8.0, 36.0])
def test_nothing_outside_moves_a_body_without_weight(months):
    """Random torques leave its centre of mass at rest."""
    world = empty_world()
    body = humanoid_in(world, months)
    world.freeze()
    world.reset(np.random.default_rng(0))
    body.place((0.0, 0.0, 1.0), 0.0, ON_BACK)
    remove_gravity(world)
    masses = np.array([bone.inertia().mass_kg for bone in body.skeleton.bones])
    centres = np.array([bone.inertia().centre for bone in body.skeleton.bones])

    def centre_of_mass():
        rotated = np.einsum("bij,bj->bi", body.bone_rotations(), centres)
        return masses @ (body.bone_positions() + rotated) / masses.sum()

    start = centre_of_mass()
    for _ in random_torques(world, [body], 1.0):
        pass
    assert np.linalg.norm(centre_of_mass() - start) < 0.002


# ---- observations


@pytest.mark.parametrize("task", ["KickTheBall", "TurnBaby"])
def test_no_observation_changes_its_shape(task, age):
    shapes = []
    for choice in ([], [f"development={age:g}"]):
        game = Game(compose([f"+task={task}", *choice]).game)
        game.reset(np.random.default_rng(0))
        (player,) = game.players
        shapes.append(
            {
                key: (spec.shape, spec.dtype, spec.low, spec.high)
                for sense in player.senses.values()
                for key, spec in sense.specs.items()
            }
        )
        for sense in player.senses.values():
            for key, array in sense.read().items():
                assert array.shape == sense.specs[key].shape
                assert np.isfinite(array).all()
        game.close()
    assert shapes[0] == shapes[1]


def test_bodies_of_several_ages_meet_in_one_world():
    world = empty_world()
    small = Walker("small", WalkerCfg(age_months=4.0), world)
    large = Walker("large", WalkerCfg(age_months=36.0), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    small.place((0.0, 0.0, 0.0))
    large.place((1.0, 0.0, 0.0), math.pi)
    for walker in (small, large):
        walker.walk(0.5, 0.0)
    let_pass(world, 2.0)
    apart_m = np.linalg.norm(small.position[:2] - large.position[:2])
    assert apart_m == pytest.approx(small.radius_m + large.radius_m, abs=0.01)
