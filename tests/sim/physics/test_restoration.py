"""Worlds after a reset equal fresh ones, share nothing, and release what they use."""

import gc
import resource
from dataclasses import replace

import numpy as np
import pytest
from composed import compose
from walking import ball, box, empty_world, film, let_pass, walker_in, wall

from veca_marl.sim.physics import World, bullet_state
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.sound import SoundCfg, make_sound
from veca_marl.sim.vision import Camera, look_at


def furnished(name="single_room"):
    return compose(["+task=KickTheBall", f"playground={name}"]).playground


def play_about(world, walker, seed, steps):
    """Shove things about for a while; return where everything was."""
    rng, seen = np.random.default_rng(seed), []
    for step in range(steps):
        if step % 10 == 0:
            walker.walk(rng.uniform(-1.0, 1.0), rng.uniform(-2.0, 2.0))
        world.step()
        seen.append(world.scene.positions.copy())
    return np.array(seen)


def strew(world, walker, rng):
    """Put the walker among toys that touch it and each other."""
    walker.place(rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0))
    for height, toy in enumerate(("block_red", "block_blue", "drum")):
        angle, away = rng.uniform(-3.0, 3.0), rng.uniform(0.15, 0.25)
        here = walker.position + away * np.array([np.cos(angle), np.sin(angle), 0.0])
        world.prop(toy).place((here[0], here[1], 0.07 + 0.1 * height))
    world.refresh()


@pytest.mark.parametrize("playground", ["single_room", "simple"])
def test_a_restored_world_equals_a_fresh_one(playground):
    """Bit by bit, over a long time among toys, whatever happened before."""

    def fresh():
        cfg = furnished(playground)
        toys = ("block_red", "block_blue", "drum")
        if playground == "simple":  # in mid air: no contact is there to be remembered
            extra = [box(name, (0.12,) * 3, 0.2, (1.0, i, 1.0)) for i, name in enumerate(toys)]
            cfg = replace(cfg, props=[*cfg.props, *extra])
        world = World(cfg)
        walker = walker_in(world)
        world.freeze()
        return world, walker

    used, its_walker = fresh()
    for seed in (0, *range(5000, 5005)):  # contacts of an episode remained in a later one
        world, walker = fresh()
        films = []
        for some_world, someone in ((world, walker), (used, its_walker)):
            some_world.reset(np.random.default_rng(0))
            strew(some_world, someone, np.random.default_rng(seed))
            films.append(play_about(some_world, someone, seed, 400 if seed == 0 else 60))
        np.testing.assert_array_equal(*films)
        assert np.ptp(films[0][:, world.prop("drum").row, 0]) > 1e-3  # it was pushed
        world.close()
    used.close()


def test_a_reset_restores_colours_and_sounds_of_everything():
    """The picture and the sound after a reset equal those of a fresh world, byte by byte."""

    def build():
        world = empty_world(ball(sound=SoundCfg()), box(colour=(0.2, 0.9, 0.1)))
        walker = walker_in(world)
        world.freeze()
        return world, walker

    def observed(world):
        world.reset(np.random.default_rng(5))
        world.refresh()
        world.step()
        source = world.prop("ball").sound
        camera_pose = look_at(np.array([-1.0, 0.3, 0.8]), np.array([0.5, 0.0, 0.1]))
        picture = Camera().render(world.scene, [camera_pose]).rgb
        memory = source.memory
        emitted = memory.powers[:, memory.end - world.clock.step_samples : memory.end].copy()
        return picture, emitted, world.scene.surfaces.colours.copy()

    fresh, (used, walker) = observed(build()[0]), build()
    used.reset(np.random.default_rng(0))
    for name in ("ball", "box", "floor", walker.name):
        used.scene.find(name).paint((0.1, 0.2, 0.3))
    source = used.prop("ball").sound
    source.muted, source.sound, walker.muted = True, make_sound(SoundCfg(frequency_hz=300.0)), True
    for one, other in zip(observed(used), fresh, strict=True):
        np.testing.assert_array_equal(one, other)
    assert fresh[1].any()
    assert not walker.muted


@pytest.mark.parametrize("spacing_m", [0.0, 0.125], ids=["overlapping", "apart"])
@pytest.mark.parametrize("seed", [1, 230])
def test_boxes_that_collide_move_as_in_the_first_episode_whatever_collided_before(spacing_m, seed):
    """Bullet's solver must not stop earlier for some boxes because of the contacts of others."""
    world = empty_world()
    places = [(spacing_m * i, 0.0, 0.06) for i in range(6)]
    edges_m = (0.12, 0.12, 0.12)
    boxes = [world.add_prop(box(f"box_{i}", edges_m, 0.2, p)) for i, p in enumerate(places)]
    world.freeze()

    def played(episode):
        rng = np.random.default_rng(episode)
        world.reset(rng)
        for prop in boxes:
            x, y, yaw_rad = rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-3.0, 3.0)
            prop.place((x, y, 0.06), yaw_rad, velocity=(*rng.uniform(-1.0, 1.0, 2), 0.0))
        world.refresh()
        return film(world, steps=40)

    first = played(seed)
    for other in range(seed + 1, seed + 4):
        played(other)
        np.testing.assert_array_equal(played(seed), first)
    world.close()


def test_worlds_in_one_process_do_not_disturb_each_other():
    def make():
        world = World(furnished())
        walker = walker_in(world)
        world.freeze()
        world.reset(np.random.default_rng(0))
        strew(world, walker, np.random.default_rng(1))
        return world, walker

    alone = play_about(*make(), seed=4, steps=60)
    (one, walker), (other, its_walker) = make(), make()
    its_walker.walk(1.0, 0.7)
    together, rng = [], np.random.default_rng(4)
    for step in range(60):
        if step % 10 == 0:
            walker.walk(rng.uniform(-1.0, 1.0), rng.uniform(-2.0, 2.0))
        one.step()
        other.step()
        together.append(one.scene.positions.copy())
    np.testing.assert_array_equal(alone, together)


def test_a_reset_restores_everything():
    """Also what the task does not place: the walker, and fixed things that were moved."""
    sounding = ball(position=(1.0, 0.0, 0.1), sound=SoundCfg())
    world = empty_world(sounding, wall(position=(3.0, 0.0, 0.0)))
    walker = walker_in(world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    start = world.scene.positions.copy()
    walker.walk(1.0, 1.0)
    walker.rotate_up_down_head(20.0)
    walker.look_toward_point((1.0, 1.0, 1.0))
    walker.adjust_focal_length(0.5)
    world.prop("ball").place((2.0, 2.0, 0.1))
    world.prop("wall").place((4.0, 0.0, 0.0))
    let_pass(world, 0.4)
    world.reset(np.random.default_rng(0))
    np.testing.assert_array_equal(world.scene.positions, start)
    np.testing.assert_array_equal(world.sound.sources["ball"].position, (1.0, 0.0, 0.1))
    assert walker.focal_distance_m == np.inf
    world.step()
    np.testing.assert_allclose(walker.position[:2], 0.0, atol=1e-12)


def bullet_counts(world):
    client = world.client
    bodies = client.getNumBodies()
    return bodies, client.getNumConstraints()


def resident_kb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.mark.slow
def test_ten_thousand_resets_leak_nothing():
    world = World(furnished())
    walker = walker_in(world)
    world.freeze()
    rng = np.random.default_rng(0)

    def reset_and_go():
        world.reset(rng)
        walker.place((0.0, 0.0, 0.0), rng.uniform(-3.0, 3.0))
        walker.walk(1.0, 0.0)
        world.step()

    for _ in range(500):
        reset_and_go()
    before, counts = resident_kb(), bullet_counts(world)
    for _ in range(10_000):
        reset_and_go()
    assert bullet_counts(world) == counts
    assert resident_kb() - before < 4_000  # 0.4 kB a reset; one leaked state would be 20


def test_closed_worlds_release_their_client():
    for _ in range(3):
        world = empty_world()
        number = world.client.id
        world.close()
        world.close()
        assert not pybullet.isConnected(number)


def test_a_world_that_is_not_referenced_any_more_releases_its_client():
    world = empty_world(ball())
    walker_in(world)
    number = world.client.id
    assert pybullet.isConnected(number)
    del world
    gc.collect()
    assert not pybullet.isConnected(number)


def test_a_state_has_the_same_bytes_where_files_are_on_a_disk(monkeypatch):
    world = World(furnished())
    in_memory = bullet_state.saved_state(world.client)
    monkeypatch.setattr(bullet_state, "_FILES_IN_MEMORY", False)
    assert bullet_state.saved_state(world.client) == in_memory
    assert bullet_state.solving_order(in_memory)
