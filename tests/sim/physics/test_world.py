"""Physical laws, the clock, and the exact restoration of worlds."""

import gc
import resource
import time
from dataclasses import replace

import numpy as np
import pytest
from composed import compose
from walking import STEP_S, ball, box, empty_world, film, let_pass, walker_in, wall

from veca_marl.sim.physics import ClockCfg, World, pybullet
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
    heights = film(world, 25)[:, world.prop("ball")._row, 2] - 0.1
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
    [(0, "1"), (-25, "1"), (26, "25 and 30"), (250, "245 and 294"), (44100, "22050")],
)
def test_an_agent_step_must_hold_a_whole_number_of_samples(wrong, nearest):
    with pytest.raises(ValueError, match=rf"control_rate_hz={wrong}: .* do: {nearest}\. "):
        ClockCfg(control_rate_hz=wrong)


@pytest.mark.parametrize("wrong", [{"substeps": 0}, {"solver_iterations": 0}])
def test_a_clock_needs_substeps_and_iterations(wrong):
    with pytest.raises(ValueError, match="at least 1"):
        ClockCfg(**wrong)


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
    for seed in range(5):
        world, walker = fresh()
        films = []
        for some_world, someone in ((world, walker), (used, its_walker)):
            some_world.reset(np.random.default_rng(0))
            strew(some_world, someone, np.random.default_rng(seed))
            films.append(play_about(some_world, someone, seed, 400 if seed == 0 else 60))
        np.testing.assert_array_equal(*films)
        assert np.ptp(films[0][:, world.prop("drum")._row, 0]) > 1e-3  # it was pushed
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
def test_boxes_that_collide_move_as_in_the_first_episode_whatever_collided_before(spacing_m):
    """Bullet's solver must not stop earlier for some boxes because of the contacts of others."""
    world = empty_world()
    places = [(spacing_m * i, 0.0, 0.06) for i in range(6)]
    edges_m = (0.12, 0.12, 0.12)
    boxes = [world.add_prop(box(f"box_{i}", edges_m, 0.2, p)) for i, p in enumerate(places)]
    world.freeze()

    def played(seed):
        rng = np.random.default_rng(seed)
        world.reset(rng)
        for prop in boxes:
            x, y, yaw_rad = rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-3.0, 3.0)
            prop.place((x, y, 0.06), yaw_rad, velocity=(*rng.uniform(-1.0, 1.0, 2), 0.0))
        world.refresh()
        return film(world, steps=40)

    first = played(1)
    for other in range(2, 5):
        played(other)
        np.testing.assert_array_equal(played(1), first)
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
    bodies = pybullet.getNumBodies(physicsClientId=client)
    return bodies, pybullet.getNumConstraints(physicsClientId=client)


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
        client = world.client
        world.close()
        world.close()
        assert not pybullet.isConnected(client)


def test_a_world_that_is_not_referenced_any_more_releases_its_client():
    world = empty_world(ball())
    walker_in(world)
    client = world.client
    assert pybullet.isConnected(client)
    del world
    gc.collect()
    assert not pybullet.isConnected(client)


def test_names_are_unique():
    world = empty_world(ball())
    with pytest.raises(ValueError, match=r"'ball' is taken; there are \['floor', 'ball'\]"):
        world.add_prop(ball())
    with pytest.raises(ValueError, match=r"\['ball'\]"):
        empty_world(ball(), ball())
    with pytest.raises(ValueError, match="'floor' is taken"):
        empty_world(ball("floor"))


def test_the_error_for_an_unknown_prop_lists_the_props():
    with pytest.raises(KeyError, match=r"no prop 'dog'.*'ball'"):
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
    with pytest.raises(RuntimeError, match="add the prop 'ball'"):
        world.add_prop(ball())
    with pytest.raises(RuntimeError, match="attach a body"):
        walker_in(world)
    with pytest.raises(RuntimeError, match="frozen"):
        world.freeze()


def test_nothing_leaves_the_room_while_a_walker_runs_about():
    """60 s of shoving toys among furniture: all stays inside, on the floor, and slow."""
    world = World(furnished())
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


@pytest.mark.parametrize("share", [0.0, -0.1, 1.5, float("nan")])
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
