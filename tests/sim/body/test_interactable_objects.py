"""Which object a verb is applied to: declared, visible, near, not behind glass."""

import pytest
from verbs import begin, seeing, toy
from walking import ball, empty_world, walker_in

from veca_marl.sim.physics import PropCfg, PropShape


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
