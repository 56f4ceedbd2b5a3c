"""Which object a verb is applied to: declared, visible, near, not behind glass."""

from types import SimpleNamespace

import numpy as np
import pytest
from verbs import begin, seeing, toy
from walking import ball, box, empty_world, walker_in

from veca_marl.sim.body.sense_organs import distance_m, interactable_props
from veca_marl.sim.physics import PropCfg, PropShape
from veca_marl.sim.physics.props import follow_physics


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


def test_props_at_any_pose_are_near_if_their_boxes_are():
    """Long tilted props near the limit of the range, against the distances to all boxes."""
    planks = [
        box(f"plank{n}", (0.05, 0.1, 1.2), 0.5, (2.0, n - 9.5, 0.7), interactions=["grab"])
        for n in range(20)
    ]
    world = empty_world(*planks)
    rng, counts = np.random.default_rng(0), []
    sight = SimpleNamespace(front_objects=lambda: dict.fromkeys(range(30), 1.0))
    for _ in range(10):
        for prop in world.props.values():
            prop.place((*rng.uniform(-3.0, 3.0, 2), 1.0))
            orientation = rng.normal(size=4)
            world.client.resetBasePositionAndOrientation(
                prop.body_id,
                prop.position.tolist(),
                (orientation / np.linalg.norm(orientation)).tolist(),
            )
        follow_physics(list(world.props.values()))
        eyes, props = np.array([0.0, 0.0, 0.6]), list(world.props.values())
        found = interactable_props(sight, eyes, props, 1.5)
        assert found == [prop for prop in props if distance_m(prop, eyes) < 1.5]
        counts.append(len(found))
    assert 0 < min(counts) <= max(counts) < 20


def test_a_prop_that_is_placed_near_is_interactable_at_once():
    world = empty_world(toy(position=(8.0, 0.0, 0.05)))
    walker = seeing(world)
    begin(world)
    assert walker.interactable_object() is None
    world.prop("toy").place((0.7, 0.0, 0.05))
    world.refresh()
    assert walker.interactable_object() is world.prop("toy")
    world.prop("toy").place((3.7, 0.0, 0.05))
    world.refresh()
    assert walker.interactable_object() is None


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
