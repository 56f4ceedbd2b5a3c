"""Props: the drawn shape is the collision shape, and impossible configurations are refused."""

import math

import numpy as np
import pytest
from refusals import naming
from walking import ball, box, empty_world, let_pass, wall

from veca_marl.sim.geometry import distances_to
from veca_marl.sim.physics import SIZE_NAMES, PartCfg, PropCfg, PropShape
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.physics.props.geoms import (
    bounding_box,
    lowest_m,
    prop_geoms,
    rotation_about_axes,
)
from veca_marl.sim.sound import SoundCfg

SIZES = {
    PropShape.sphere: [0.2],
    PropShape.box: [0.2, 0.4, 0.6],
    PropShape.cylinder: [0.2, 0.5],
    PropShape.capsule: [0.2, 0.5],
    PropShape.wall: [2.0, 0.1, 1.0],
    PropShape.goal: [1.2, 0.8, 0.04],
    PropShape.pyramid: [0.3, 0.4, 0.5],
    PropShape.sector: [0.3, 0.2],
    PropShape.doll: [0.6],
    PropShape.compound: [],
    PropShape.convex: [],
}
PIECES = {
    PropShape.compound: {
        "parts": [
            PartCfg(PropShape.box, [0.4, 0.1, 0.2], rotation_deg=(0.0, 20.0, 30.0)),
            PartCfg(PropShape.pyramid, [0.2, 0.2, 0.3], (0.1, 0.2, 0.1), (50.0, 0.0, 0.0)),
        ]
    },
    PropShape.convex: {
        "points_m": [[0.2, 0, 0], [-0.2, 0.1, 0], [0, -0.3, 0.1], [0, 0, 0.4], [0.1, 0.2, 0.3]]
    },
}


def of(shape, **more):
    return PropCfg(name="thing", shape=shape, size_m=SIZES[shape], **PIECES.get(shape, {}), **more)


@pytest.mark.parametrize("shape", PropShape)
def test_the_drawn_shape_is_the_collision_shape(shape):
    """Rays of the physics hit exactly where the drawn primitives are."""
    world = empty_world(of(shape, position_m=(0.3, -0.2, 1.0), yaw_deg=33.0))
    world.refresh()
    rng = np.random.default_rng(0)
    low, high = world.prop("thing").bounds()
    points = rng.uniform(low, high, (3000, 3))
    inside = np.zeros(len(points), bool)
    for geom in prop_geoms(world.prop("thing").cfg):
        own = (points - world.prop("thing").position) @ world.prop("thing").rotation
        inside |= distances_to(geom, own) < 0.0
    probe = world.client.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.001)
    needle = world.client.createMultiBody(0, probe)
    solid = []
    for point in points:
        world.client.resetBasePositionAndOrientation(needle, point, (0, 0, 0, 1))
        near = world.client.getClosestPoints(needle, world.prop("thing").body_id, 0.5)
        solid.append(bool(near) and min(n.distance_m for n in near) < -0.001)
    assert inside.sum() > 10
    assert np.mean(inside != np.array(solid)) < 0.003


def inside_points(geoms, rng):
    """Return random points in primitives, ``(n, 3)``, in their frame."""
    points = rng.uniform(-1.3, 1.3, (400_000, 3))
    return points[np.any([distances_to(geom, points) < 0.0 for geom in geoms], axis=0)]


LEANING = (
    PartCfg(PropShape.cylinder, [0.4, 0.05], (0.1, 0.0, 0.0), (30.0, 50.0, 0.0)),
    PartCfg(PropShape.capsule, [0.1, 0.6], (-0.1, 0.2, 0.0), (70.0, 0.0, 0.0)),
)


@pytest.mark.parametrize(
    "cfg",
    [
        of(PropShape.cylinder),
        of(PropShape.capsule),
        of(PropShape.compound),
        of(PropShape.goal),
        PropCfg("leaning", PropShape.compound, parts=list(LEANING)),
    ],
    ids=lambda cfg: f"{cfg.name} {cfg.shape.name}",
)
def test_the_box_and_the_lowest_point_are_tight(cfg):
    geoms, rng = prop_geoms(cfg), np.random.default_rng(3)
    points = inside_points(geoms, rng)
    low, high = bounding_box(geoms)
    for found, bound, outside in ((points.min(0), low, -1.0), (points.max(0), high, 1.0)):
        assert (outside * (bound - found) >= 0.0).all()
        np.testing.assert_allclose(found, bound, atol=0.1)
    for degrees in ((0.0, 0.0, 0.0), (45.0, 0.0, 0.0), (20.0, 130.0, 70.0)):
        rotation = rotation_about_axes(degrees)
        lowest = (points @ rotation.T)[:, 2].min()
        assert lowest - 0.1 <= lowest_m(geoms, rotation) <= lowest


def test_a_tilted_plate_has_its_lowest_point_at_its_rim():
    plate_cfg = PropCfg("plate", PropShape.cylinder, [0.3, 0.02], (0.0, 0.0, 1.0), mass_kg=1.0)
    world = empty_world(plate_cfg)
    plate = world.prop("plate")
    assert plate.lowest_m == pytest.approx(0.99)
    turned = pybullet.getQuaternionFromEuler([math.pi / 2.0, 0.0, 0.0])
    world.client.resetBasePositionAndOrientation(plate.body_id, (0.0, 0.0, 1.0), turned)
    world.refresh()
    assert plate.lowest_m == pytest.approx(0.7, abs=1e-3)


@pytest.mark.parametrize("shape", [PropShape.sphere, PropShape.box, PropShape.cylinder])
def test_a_prop_rests_on_the_floor(shape):
    half = SIZES[shape][-1] if shape is PropShape.sphere else SIZES[shape][-1] / 2
    world = empty_world(of(shape, mass_kg=1.0, position_m=(0.0, 0.0, half + 0.05)))
    let_pass(world, 2.0)
    assert world.prop("thing").position[2] == pytest.approx(half, abs=0.003)
    assert world.prop("thing").lowest_m == pytest.approx(0.0, abs=0.025)  # Bullet's AABB margin


def test_a_goal_has_two_posts_on_the_floor_and_a_bar_over_them():
    world = empty_world(of(PropShape.goal))
    world.refresh()
    table, rows = world.scene.geoms, world.scene.find("thing").geoms
    left, right, bar = range(rows.start, rows.stop)
    for post, y in ((left, -0.6), (right, 0.6)):
        np.testing.assert_allclose(table.positions[post], (0.0, y, 0.4), atol=1e-6)
        assert table.sizes[post][1] == pytest.approx(0.8)
        np.testing.assert_allclose(table.rotations[post][:, 2], (0.0, 0.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(table.positions[bar], (0.0, 0.0, 0.8), atol=1e-6)
    np.testing.assert_allclose(np.abs(table.rotations[bar][:, 2]), (0.0, 1.0, 0.0), atol=1e-6)
    assert table.sizes[bar][1] == pytest.approx(1.2)


def test_a_fixed_prop_stays():
    world = empty_world(box(mass_kg=0.0, position=(0.0, 0.0, 2.0)))
    world.prop("box").set_velocity((5.0, 0.0, 0.0))
    let_pass(world, 0.4)
    np.testing.assert_array_equal(world.prop("box").position, (0.0, 0.0, 2.0))
    assert world.prop("box").fixed


def test_place_sets_the_whole_pose_and_the_velocities():
    world = empty_world(box(position=(0.0, 0.0, 2.0)))
    thing = world.prop("box")
    thing.set_velocity((0.0, 0.0, 0.0), (3.0, 2.0, 1.0))
    let_pass(world, 0.4)
    thing.place((1.0, 2.0, 3.0), math.pi / 2, velocity=(0.5, 0.0, 0.0))
    np.testing.assert_array_equal(thing.position, (1.0, 2.0, 3.0))
    np.testing.assert_allclose(thing.rotation[:, 0], (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_array_equal(thing.velocity, (0.5, 0.0, 0.0))


def test_its_sound_source_follows():
    world = empty_world(ball(position=(0.0, 0.0, 0.1), sound=SoundCfg()))
    world.prop("ball").set_velocity((1.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    let_pass(world, 0.4)
    source = world.sound.sources["ball"]
    assert source is world.prop("ball").sound
    np.testing.assert_array_equal(source.position, world.prop("ball").position)
    assert source.position[0] > 0.3


def test_returned_positions_are_copies():
    world = empty_world(ball(position=(0.0, 0.0, 2.0)))
    before = world.prop("ball").position
    let_pass(world, 0.4)
    assert before[2] == 2.0


@pytest.mark.parametrize("shape", PropShape)
def test_sizes_are_counted_and_named(shape):
    some = [-1.0] * (len(SIZES[shape]) or 1)
    for wrong in ([*SIZES[shape], 1.0], some, [math.nan] * 3):
        with pytest.raises(
            ValueError, match=naming("'thing'", f"size_m={wrong}", *SIZE_NAMES[shape])
        ):
            PropCfg(name="thing", shape=shape, size_m=wrong)


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("mass_kg", -1.0),
        ("mass_kg", math.nan),
        ("friction", -0.1),
        ("rolling_friction", math.inf),
        ("restitution", 1.5),
        ("restitution", math.nan),
        ("position_m", (0.0, math.nan, 0.0)),
        ("yaw_deg", math.inf),
    ],
)
def test_impossible_numbers_are_refused(field, wrong):
    with pytest.raises(ValueError, match=field):
        of(PropShape.sphere, **{field: wrong})


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        (
            {"shape": PropShape.pyramid, "size_m": [0.1, 0.1, 0.0015]},
            ("size_m=[0.1, 0.1, 0.0015]", "pyramid"),
        ),
        (
            {"shape": PropShape.sector, "size_m": [0.2, 0.04], "angle_deg": 0.4},
            ("size_m=[0.2, 0.04]", "angle_deg=0.4"),
        ),
        (
            {
                "shape": PropShape.convex,
                "points_m": [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.002]],
            },
            ("points_m=", "[0, 0, 0.002]", "convex"),
        ),
    ],
)
def test_a_polyhedron_too_thin_to_collide_is_refused_by_its_name(numbers, parts):
    with pytest.raises(ValueError, match=naming("prop 'thin'", "1 mm", *parts)):
        PropCfg("thin", **numbers)
    with pytest.raises(ValueError, match=naming("part", "1 mm", *parts)):
        PartCfg(**numbers)


def test_the_error_for_an_unknown_shape_lists_the_shapes():
    with pytest.raises(ValueError, match=naming("'thing'", "shape='torus'", "sphere")):
        PropCfg(name="thing", shape="torus", size_m=[1.0])


def test_a_prop_needs_a_name():
    with pytest.raises(ValueError, match=naming("sphere", "name")):
        PropCfg(shape=PropShape.sphere, size_m=[0.1])


def test_a_position_must_be_finite():
    thing = empty_world(ball()).prop("ball")
    for wrong in ((0.0, 0.0), (0.0, math.nan, 0.0)):
        with pytest.raises(ValueError, match=naming("'ball'", "position")):
            thing.place(wrong)
        with pytest.raises(ValueError, match=naming("'ball'", "velocity")):
            thing.set_velocity(wrong)


def test_radius_is_that_of_the_cylinder_round_it():
    world = empty_world(of(PropShape.box), ball(radius_m=0.07), wall(length_m=3.0))
    assert world.prop("thing").radius_m == pytest.approx(math.hypot(0.2, 0.4) / 2)
    assert world.prop("ball").radius_m == 0.07
    assert world.prop("wall").radius_m == pytest.approx(math.hypot(3.0, 0.1) / 2)


def test_an_intangible_prop_is_only_seen():
    mark = PropCfg(name="mark", shape=PropShape.cylinder, size_m=[0.1, 0.05], tangible=False)
    world = empty_world(mark, ball(position=(0.0, 0.0, 0.3), restitution=0.0))
    let_pass(world, 1.0)
    resting = world.prop("ball")
    assert resting.position[2] == pytest.approx(resting.cfg.size_m[0], abs=0.002)
    own = world.scene.geoms.objects == world.prop("mark").object_id
    assert not world.scene.geoms.tangible[own].any()
    assert world.scene.geoms.visible[own].all()


def test_an_intangible_prop_must_be_fixed():
    with pytest.raises(ValueError, match="mass_kg"):
        PropCfg(name="mark", size_m=[1.0, 1.0, 1.0], mass_kg=1.0, tangible=False)


def test_a_movable_wall_is_placed_by_its_foot_and_turns_about_its_centre():
    cfg = PropCfg(name="wall", shape=PropShape.wall, size_m=[1.0, 0.1, 0.5], mass_kg=2.0)
    world = empty_world(cfg)
    world.freeze()
    thing = world.prop("wall")
    thing.place((1.0, 2.0, 3.0), 0.7)
    np.testing.assert_allclose(thing.position, (1.0, 2.0, 3.0), atol=1e-12)
    low, high = world.client.getAABB(thing.body_id)
    assert (low[2] + high[2]) / 2 == pytest.approx(3.25, abs=1e-3)
    world.reset(np.random.default_rng(0))
    np.testing.assert_allclose(thing.position, cfg.position_m, atol=1e-12)
