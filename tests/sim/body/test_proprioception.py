"""Proprioception: order and units of its parts, and the vestibular sense in known motion."""

import math

import numpy as np
import pytest
from humanoids import remove_gravity
from refusals import naming
from walking import empty_world, let_pass, walker_in

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK, ON_BELLY
from veca_marl.sim.body.proprioception import (
    ProprioceptionCfg,
    ProprioceptionQuality,
    ProprioceptionSense,
)
from veca_marl.sim.sense import check_spec

STEP_S = 0.04


@pytest.fixture
def child():
    world = empty_world()
    body = Humanoid("child", HumanoidCfg(detail=Detail.mitten), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    yield world, body
    world.close()


def sense_of(world, body, **cfg):
    return ProprioceptionSense(ProprioceptionCfg(**cfg), body, world)


def parts(sense):
    vector = sense.read()["proprioception"]
    check_spec("proprioception", vector, sense.specs["proprioception"])
    return {name: vector[part].copy() for name, part in sense.parts.items()}


def test_the_parts_fill_the_vector_in_the_documented_order(child):
    sense = sense_of(*child)
    assert list(sense.parts) == [
        "bone_orientations",
        "joint_angles",
        "joint_velocities",
        "joint_torques",
        "head_acceleration",
        "head_turning",
    ]
    filled = np.concatenate([np.arange(534)[part] for part in sense.parts.values()])
    np.testing.assert_array_equal(filled, np.arange(534))
    assert sense.specs["proprioception"].shape == (534,)


def test_joint_states_equal_those_of_the_body(child):
    world, body = child
    sense = sense_of(world, body)
    body.act({"joints": np.random.default_rng(0).uniform(-1, 1, 82)})
    let_pass(world, 0.2)
    felt = parts(sense)
    for name in ("joint_angles", "joint_velocities", "joint_torques"):
        expected = getattr(body, name)()
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(felt[name], expected, rtol=1e-6, atol=1e-7)


def test_a_body_at_rest_senses_gravity_only(child):
    world, body = child
    body.place((0.0, 0.0, 0.0), 0.4, ON_BACK)
    let_pass(world, 5.0)
    sense, felt, up = sense_of(world, body), [], []
    for _ in range(50):
        world.step()
        felt.append(parts(sense)["head_acceleration"])
        up.append(body.mount("head").rotation.T @ np.array([0.0, 0.0, 9.81]))
    np.testing.assert_allclose(np.mean(felt, 0), np.mean(up, 0), atol=0.1)


def test_free_fall_senses_no_specific_force(child):
    world, body = child
    body.place((0.0, 0.0, 3.0))
    sense = sense_of(world, body)
    let_pass(world, STEP_S)
    np.testing.assert_allclose(parts(sense)["head_acceleration"], 0.0, atol=0.1)


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_an_acceleration_is_the_mean_over_all_steps_since_the_last_reading(child, steps):
    """In free fall the specific force is 0, however often the sense is read."""
    world, body = child
    body.place((0.0, 0.0, 5.0))
    sense = sense_of(world, body)
    sense.reset()
    let_pass(world, steps * STEP_S)
    np.testing.assert_allclose(parts(sense)["head_acceleration"], 0.0, atol=0.2)


def test_weightless_rest_senses_the_specific_force_of_a_rocket(child):
    world, body = child
    remove_gravity(world)
    body.place((0.0, 0.0, 3.0))
    sense = sense_of(world, body)
    let_pass(world, STEP_S)
    # without gravity and contact, the model still adds g: as in a rocket with a thrust of 1 g;
    # Bullet's stops push joints that are at a limit by 0.01 rad into their range
    np.testing.assert_allclose(parts(sense)["head_acceleration"], (0.0, 0.0, 9.81), atol=0.02)


def test_orientations_show_the_vertical_but_no_compass_direction(child):
    world, body = child
    sense = sense_of(world, body)
    seen = []
    for yaw_rad in (0.0, 1.0, -2.5):
        body.place((1.0, 2.0, 0.0), yaw_rad, ON_BELLY)
        world.refresh()
        seen.append(parts(sense)["bone_orientations"])
    np.testing.assert_allclose(seen[1], seen[0], atol=1e-5)
    np.testing.assert_allclose(seen[2], seen[0], atol=1e-5)
    body.place((1.0, 2.0, 0.0), 0.0, ON_BACK)
    world.refresh()
    assert np.abs(parts(sense)["bone_orientations"] - seen[0]).max() > 1.0


def test_an_upright_pelvis_reads_forward_and_up(child):
    world, body = child
    body.place((0.0, 0.0, 0.0), 0.7)
    world.refresh()
    pelvis = parts(sense_of(world, body))["bone_orientations"][:6]
    np.testing.assert_allclose(pelvis, (1.0, 0.0, 0.0, 0.0, 0.0, 1.0), atol=1e-6)


@pytest.mark.parametrize(
    ("quality", "kept"),
    [
        (ProprioceptionQuality.full, ("bone", "joint", "head")),
        (ProprioceptionQuality.joints, ("joint",)),
        (ProprioceptionQuality.vestibular, ("head",)),
    ],
)
def test_quality_changes_content_but_not_shape(child, quality, kept):
    world, body = child
    sense = sense_of(world, body, quality=quality)
    body.act({"joints": np.random.default_rng(0).uniform(-1, 1, 82)})
    let_pass(world, 0.2)
    for name, part in parts(sense).items():
        assert part.any() == name.startswith(kept), name


def test_a_walker_has_the_same_parts():
    world = empty_world()
    walker = walker_in(world)
    sense = sense_of(world, walker)
    walker.walk(0.5, 0.8)
    let_pass(world, 1.0)
    sense.read()
    world.step()
    felt = parts(sense)
    assert felt["joint_angles"].any()
    assert felt["joint_velocities"].any()
    assert not felt["joint_torques"].any()
    assert felt["head_turning"][2] == pytest.approx(0.8 * math.cos(math.radians(12.0)), abs=0.05)
    assert np.linalg.norm(felt["head_acceleration"]) == pytest.approx(9.81, abs=4.0)  # of a step
    world.close()


def test_velocities_of_walking_bones_equal_their_displacement():
    world = empty_world()
    walker = walker_in(world)
    walker.walk(0.5, 0.0)
    let_pass(world, 1.0)
    before = walker.bone_positions()
    world.step()
    moved = (walker.bone_positions() - before) / STEP_S
    hands = [walker.bone_names.index(name) for name in ("l_hand", "r_hand")]
    np.testing.assert_allclose(walker.velocities()[hands], moved[hands], atol=0.1)
    world.close()


def test_a_walker_feels_its_head_rise_and_fall_with_each_step():
    world = empty_world()
    walker = walker_in(world)
    sense = sense_of(world, walker)
    walker.walk(1.0, 0.0)
    let_pass(world, 1.0)
    heights, speeds, forces = [walker.mount("head").position[2]], [], []
    sense.read()
    for _ in range(25):
        world.step()
        heights.append(walker.mount("head").position[2])
        speeds.append(walker.head_motion()[0][2])
        in_head = parts(sense)["head_acceleration"]
        forces.append((walker.mount("head").rotation @ in_head)[2])
    world.close()
    moved = np.diff(heights) / STEP_S
    assert np.abs(moved).max() > 0.1
    np.testing.assert_allclose(speeds, moved, atol=0.01)
    np.testing.assert_allclose(forces[1:], 9.81 + np.diff(moved) / STEP_S, atol=0.5)


def test_a_crawling_walker_that_turns_moves_its_pelvis_sideways():
    """The pelvis is behind the middle of the body, about which it turns."""
    world = empty_world()
    walker = walker_in(world, verbs=["crawl"])
    assert walker.crawl()
    walker.walk(0.0, 0.5)
    let_pass(world, 1.0)
    before = walker.position
    world.step()
    moved = (walker.position - before) / STEP_S
    assert np.linalg.norm(moved) > 0.05
    np.testing.assert_allclose(walker.velocities()[0], moved, atol=1e-6)
    world.close()


def test_an_unknown_quality_is_refused():
    with pytest.raises(
        ValueError, match=naming("senses.proprioception.quality='sharp'", "vestibular")
    ):
        ProprioceptionCfg(quality="sharp")
