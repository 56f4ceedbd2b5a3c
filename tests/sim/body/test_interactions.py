"""Verbs of walkers: which object they are applied to, what they do, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from walking import ball, box, empty_world, let_pass, walker_in, wall

from veca_marl.sim.body.walker import WalkCommand, WalkerCfg
from veca_marl.sim.physics import PropCfg, PropShape
from veca_marl.sim.physics.props.joint_cfg import LockCfg
from veca_marl.sim.physics.props.library import door_leaf
from veca_marl.sim.vision import Camera, open_eyes

VERBS = ["grab", "release", "kick"]


def toy(name="toy", position=(0.7, 0.0, 0.05), **more):
    return ball(name, radius_m=0.05, position=position, interactions=["grab"], **more)


def seeing(world, name="walker", place=(0.0, 0.0, 0.0), yaw_deg=0.0, extra_verbs=()):
    verbs = [*VERBS, *extra_verbs]
    walker = walker_in(world, name, place, yaw_deg, verbs=verbs, head_pitch_deg=25.0)
    open_eyes(world.scene, walker, Camera(42, 42))
    return walker


def do(world, walker, verb, forward=0.0, turn=0.0):
    """Play one step in which a walker chooses a verb; return whether it had an effect."""
    walker.act(walker.encode(WalkCommand(forward, turn, verb=verb)))
    world.step()
    assert walker.verb_was_refused == (verb != "none" and walker.applied_verb is None)
    return walker.applied_verb is not None


def begin(world):
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.refresh()


def test_objects_are_interactable_if_declared_seen_near_and_not_behind_glass():
    pane = PropCfg(
        "pane", PropShape.box, [0.02, 0.2, 0.6], (0.45, 0.19, 0.3), transparent=True, yaw_deg=23.0
    )
    world = empty_world(
        toy(),
        toy("beside", (0.65, -0.1, 0.05)),
        toy("behind_glass", (0.7, 0.3, 0.05)),
        toy("far", (2.4, 0.0, 0.05)),
        toy("behind", (-0.5, 0.0, 0.05)),
        ball("undeclared", position=(0.6, -0.3, 0.1)),
        pane,
    )
    walker = seeing(world)
    begin(world)
    visible = {name for name, prop in world.props.items() if walker.is_visible(prop)}
    assert visible == {"toy", "beside", "behind_glass", "far", "undeclared", "pane"}
    assert [prop.name for prop in walker.interactable_objects()] == ["toy", "beside"]
    assert walker.interactable_object() is world.prop("toy")
    for name, prop in world.props.items():
        assert walker.is_interactable(prop) == (name in ("toy", "beside"))


def test_the_object_nearest_to_the_centre_of_the_view_follows_the_gaze():
    world = empty_world(toy("a", (0.7, 0.15, 0.05)), toy("b", (0.7, -0.1, 0.05)))
    walker = seeing(world)
    begin(world)
    assert walker.interactable_object() is world.prop("b")
    walker.look_toward_point(world.prop("a").position)
    assert walker.interactable_object() is world.prop("a")


def test_one_eye_can_be_asked_and_a_closed_one_is_refused():
    world = empty_world(toy())
    walker = seeing(world)
    begin(world)
    assert walker.is_visible(world.prop("toy"), "eye_left")
    with pytest.raises(ValueError, match=r"eye_middle.*eye_left"):
        walker.is_visible(world.prop("toy"), "eye_middle")


def test_a_body_without_eyes_says_how_it_gets_them():
    world = empty_world(toy())
    with pytest.raises(RuntimeError, match="open_eyes"):
        walker_in(world).interactable_objects()


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
    hand_mps = walker.velocity
    do(world, walker, "release")
    # it keeps the velocity of the hand, falls, and is not expelled from the wall
    assert np.linalg.norm(world.prop("toy").velocity - hand_mps) < 0.5


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


def test_a_kick_is_a_verb_too():
    world = empty_world(ball(position=(0.3, 0.0, 0.1), interactions=["kick"]))
    walker = seeing(world)
    walker.rotate_up_down_head(25.0)
    begin(world)
    walker.rotate_up_down_head(25.0)
    world.refresh()
    assert do(world, walker, "kick")
    assert world.prop("ball").velocity[0] > 1.0


def test_unknown_verbs_are_refused_where_they_are_named():
    with pytest.raises(ValueError, match=r"body.verbs: .*'grap'.*did you mean grab"):
        WalkerCfg(verbs=["grap"])
    with pytest.raises(ValueError, match="once"):
        WalkerCfg(verbs=["grab", "grab"])
    with pytest.raises(ValueError, match=r"prop 'ball': interactions: .*'throw'"):
        empty_world(ball(interactions=["throw"]))
    with pytest.raises(ValueError, match=r"verb 'grab'.*none"):
        walker_in(empty_world()).encode(WalkCommand(0.0, 0.0, verb="grab"))


# ---- containers, buttons, and verbs that change how a walker moves

BASKET = ("basket", (0.3, 0.3, 0.02), 0.0, (0.6, 0.0, 0.01))  # a plate: what is put on it stays


def plate(**more):
    name, edges_m, mass_kg, position = BASKET
    return box(name, edges_m, mass_kg, position, interactions=["put_into"], **more)


def test_what_is_put_into_a_container_lies_in_it():
    world = empty_world(toy(position=(0.5, 0.5, 0.05)), plate())
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    prop, basket = world.prop("toy"), world.prop("basket")
    assert not do(world, walker, "put_into")  # the hand is empty
    walker.grab(prop)
    basket.accepts = lambda one: False
    assert not do(world, walker, "put_into")
    assert walker.held is prop
    basket.accepts = lambda one: one is prop
    assert do(world, walker, "put_into")
    assert walker.applied_verb == ("put_into", basket)
    assert walker.held is None
    let_pass(world, 0.4)
    assert prop.position[2] == pytest.approx(0.07, abs=0.01)
    low, high = basket.bounds()
    assert ((low < prop.position)[:2] & (prop.position < high)[:2]).all()


@pytest.mark.parametrize("yaw_deg", [0.0, 45.0])
def test_several_props_lie_side_by_side_in_a_container(yaw_deg):
    cubes = [
        box(f"cube{i}", (0.1, 0.1, 0.1), 0.2, (0.5, 0.8 + 0.3 * i, 0.05), interactions=["grab"])
        for i in range(3)
    ]
    world = empty_world(*cubes, plate(yaw_deg=yaw_deg))
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    for i in range(3):
        walker.grab(world.prop(f"cube{i}"))
        assert do(world, walker, "put_into")  # also with a cube nearer to the centre of the view
        let_pass(world, 0.4)
    heights = [world.prop(f"cube{i}").position[2] for i in range(3)]
    assert heights == pytest.approx([0.07] * 3, abs=0.01)
    assert len({tuple(np.round(world.prop(f"cube{i}").position[:2], 2)) for i in range(3)}) == 3


def test_a_prop_that_is_too_wide_for_a_container_is_refused():
    world = empty_world(ball("toy", 0.2, position=(0.5, 0.7, 0.2)), plate())
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    walker.grab(world.prop("toy"))
    assert not do(world, walker, "put_into")


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


# ---- doors and keys


def door(lock=None):
    leaf = door_leaf("door", (1.0, 0.0), 0.0, 0.7, 1.0, opens_to_front=True, lock=lock)
    return replace(leaf, interactions=["open", "close"])


def test_a_door_is_opened_and_closed():
    world = empty_world(door())
    walker = seeing(world, extra_verbs=["open", "close"])
    begin(world)
    assert not do(world, walker, "close")  # it is closed
    assert not do(world, walker, "grab")
    assert do(world, walker, "open")
    let_pass(world, 3.0)
    assert world.prop("door").opening > 0.9
    walker.look_toward_point(world.prop("door").position)
    world.refresh()
    assert do(world, walker, "close")
    let_pass(world, 3.0)
    assert world.prop("door").opening < 0.1


def test_a_locked_door_opens_with_its_key_in_the_hand_only():
    lock = LockCfg(key="key")
    world = empty_world(door(lock), toy("key", (0.5, 0.7, 0.05)), toy("other", (0.5, -0.7, 0.05)))
    walker = seeing(world, extra_verbs=["open"])
    begin(world)
    leaf = world.prop("door")
    assert not do(world, walker, "open")
    walker.grab(world.prop("other"))
    assert not do(world, walker, "open")
    assert leaf.locked
    walker.release()
    walker.grab(world.prop("key"))
    assert do(world, walker, "open")
    let_pass(world, 2.0)
    assert (leaf.locked, leaf.opening > 0.5) == (False, True)
    world.reset(np.random.default_rng(0))
    assert (leaf.locked, leaf.opening) == (True, pytest.approx(0.0, abs=1e-3))


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
