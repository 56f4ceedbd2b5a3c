"""Compound props: baskets, dolls, mass properties, and the reset with several contacts."""

import math
import tempfile

import numpy as np
import pytest
from composed import compose
from refusals import naming
from walking import ball, box, empty_world, film, let_pass, walker_in

from veca_marl.sim.geometry import joined_inertia, primitive_inertia
from veca_marl.sim.physics import ClockCfg, PartCfg, PlaygroundCfg, PropCfg, PropShape, World
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.physics.props.geoms import prop_geoms
from veca_marl.sim.physics.props.toys import fraction_piece


def basket(mass_kg=0.0, edge_m=0.4, height_m=0.2, thickness_m=0.02):
    side, up = edge_m / 2.0, height_m / 2.0
    boards = [PartCfg(PropShape.box, [edge_m, edge_m, thickness_m], (0, 0, thickness_m / 2))]
    for way in (-1.0, 1.0):
        boards.append(PartCfg(PropShape.box, [edge_m, thickness_m, height_m], (0, way * side, up)))
        boards.append(PartCfg(PropShape.box, [thickness_m, edge_m, height_m], (way * side, 0, up)))
    return PropCfg("basket", PropShape.compound, mass_kg=mass_kg, parts=boards)


def lopsided(**more):
    parts = [
        PartCfg(PropShape.box, [0.4, 0.1, 0.1]),
        PartCfg(PropShape.cylinder, [0.05, 0.3], (0.2, 0.1, 0.1), (40.0, 0.0, 20.0)),
        PartCfg(PropShape.pyramid, [0.1, 0.1, 0.2], (-0.1, -0.1, 0.1), colour=(1.0, 0.0, 0.0)),
    ]
    return PropCfg("thing", PropShape.compound, parts=parts, mass_kg=1.5, **more)


def test_an_asymmetric_compound_turns_as_its_parts_together():
    """Bullet's mass, centre and principal moments are those of the parts from the theorem."""
    world = empty_world(lopsided(position_m=(0.0, 0.0, 5.0), yaw_deg=30.0))
    prop, geoms = world.prop("thing"), prop_geoms(lopsided())
    volumes = np.array([geom.volume for geom in geoms])
    masses = 1.5 * volumes / volumes.sum()
    frame = geoms[0].pose
    parts = [
        (frame._replace(position=np.zeros(3), rotation=np.eye(3)), primitive_inertia(geom, mass))
        for geom, mass in zip(geoms, masses, strict=True)
    ]
    whole = joined_inertia(parts)
    centre, quaternion = world.client.getBasePositionAndOrientation(prop.body_id)
    np.testing.assert_allclose(
        prop.rotation.T @ (np.array(centre) - prop.position), whole.centre, atol=1e-9
    )
    axes = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
    info = world.client.getDynamicsInfo(prop.body_id, -1)
    matrix = axes @ np.diag(info.moments) @ axes.T
    np.testing.assert_allclose(prop.rotation.T @ matrix @ prop.rotation, whole.matrix, atol=1e-9)
    assert info.mass_kg == pytest.approx(1.5)


def test_a_compound_that_falls_and_spins_keeps_its_angular_momentum():
    world = empty_world(lopsided(position_m=(0.0, 0.0, 50.0)))
    prop = world.prop("thing")
    prop.set_velocity((0.0, 0.0, 0.0), (3.0, -2.0, 4.0))

    def momentum():
        _, quaternion = world.client.getBasePositionAndOrientation(prop.body_id)
        axes = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        moments = world.client.getDynamicsInfo(prop.body_id, -1).moments
        _, spin = world.client.getBaseVelocity(prop.body_id)
        return axes @ (np.array(moments) * (axes.T @ np.array(spin)))

    before = momentum()
    let_pass(world, 1.0)
    assert np.linalg.norm(momentum() - before) < 0.03 * np.linalg.norm(before)


@pytest.mark.parametrize("substeps", [5, 20, 40])
def test_the_rebound_does_not_depend_on_which_part_lands(substeps):
    speeds = []
    for heights in [(0.0, 0.1), (0.1, 0.0)]:
        parts = [PartCfg(PropShape.sphere, [0.05], (0.0, 0.0, height)) for height in heights]
        numbers = {"mass_kg": 0.2, "restitution": 0.7, "friction": 0.0}
        two = PropCfg("two", PropShape.compound, [], (0.0, 0.0, 0.55), parts=parts, **numbers)
        world = empty_world(two, clock=ClockCfg(substeps=substeps))
        seen = record_speeds(world, "two")
        let_pass(world, 0.6)
        speeds.append(max(seen) / -min(seen))
    assert speeds[0] == pytest.approx(speeds[1], abs=0.01)
    assert speeds[0] == pytest.approx(0.7, abs=0.1)


def record_speeds(world, name):
    """Return a list to which each physics step adds the vertical speed of a prop."""
    seen = []
    world.after_substep.append(lambda: seen.append(world.prop(name).velocity[2]))
    return seen


def test_each_part_has_its_pose_and_colour():
    world = empty_world(lopsided(position_m=(1.0, 2.0, 0.5), yaw_deg=90.0, colour=(0, 0, 1)))
    world.refresh()
    table, rows = world.scene.geoms, world.scene.find("thing").geoms
    np.testing.assert_allclose(table.positions[rows.start + 1], (0.9, 2.2, 0.6), atol=1e-6)
    np.testing.assert_array_equal(table.colours[rows], [(0, 0, 1), (0, 0, 1), (1, 0, 0)])


def test_a_doll_stands_on_its_feet_and_faces_x():
    doll = PropCfg("doll", PropShape.doll, [0.4], (0.0, 0.0, 0.2), mass_kg=0.5)
    world = empty_world(doll)
    let_pass(world, 2.0)
    prop = world.prop("doll")
    assert prop.rotation[2, 2] > 0.999
    assert prop.position[2] == pytest.approx(0.2, abs=0.003)
    low, high = prop.bounds()
    assert high[2] - low[2] == pytest.approx(0.4, abs=0.01)


def test_a_basket_holds_and_contains_what_falls_into_it():
    world = empty_world(basket(), ball("inside", 0.05, position=(0.05, 0.02, 0.4)),
                        ball("beside", 0.05, position=(0.6, 0.0, 0.05)))  # fmt: skip
    holder = world.prop("basket")
    assert not holder.contains(world.prop("inside"))
    let_pass(world, 2.0)
    inside = world.prop("inside").position
    assert holder.contains(world.prop("inside"))
    assert not holder.contains(world.prop("beside"))
    assert np.abs(inside[:2]).max() < 0.2
    assert inside[2] == pytest.approx(0.07, abs=0.004)
    holder.place((0.0, 3.0, 0.0), math.radians(45.0))
    world.prop("inside").place((0.0, 3.2, 0.1))
    assert holder.contains(world.prop("inside"))


@pytest.mark.parametrize("mass_kg", [0.0, 0.8])
def test_things_in_a_basket_move_alike_after_every_reset(mass_kg):
    """Several shapes of one body are in contact at once; those of movable ones are on links."""
    places = [(-0.12, 0.1, 0.3), (0.0, 0.01, 0.3), (0.12, -0.08, 0.3)]
    things = [ball(f"ball {n}", 0.05, position=place) for n, place in enumerate(places)]
    cube = box("cube", (0.1, 0.1, 0.1), 0.2, (0.05, 0.0, 0.5))
    doll = PropCfg("doll", PropShape.doll, [0.3], (0.8, 0.0, 0.16), mass_kg=0.5)
    world = empty_world(basket(mass_kg), *things, doll, cube)
    world.freeze()
    paths = []
    for _ in range(3):
        world.reset(np.random.default_rng(0))
        paths.append(film(world, 30))
    np.testing.assert_array_equal(paths[0], paths[1])
    np.testing.assert_array_equal(paths[0], paths[2])


def test_a_basket_contains_a_thing_by_its_centre_of_mass():
    """The frame of a sector is at its tip, its centre of mass is not."""
    piece = fraction_piece("piece", 0.25, (0.0, 0.0))
    world = empty_world(basket(), piece)
    piece, holder = world.prop("piece"), world.prop("basket")
    inside_m = holder.box[1][0] - piece.centre_of_mass[0]
    piece.place((inside_m - 0.01, 0.0, 0.1))
    assert holder.contains(piece)
    piece.place((inside_m + 0.01, 0.0, 0.1))
    assert not holder.contains(piece)


def test_fraction_pieces_fill_a_disc_without_overlap():
    angles, turn, pieces = (180.0, 90.0, 60.0, 30.0), 0.0, []
    for number, angle in enumerate(angles):
        pieces.append(
            PropCfg(f"piece {number}", PropShape.sector, [0.3, 0.05], (0, 0, 0.025),
                    yaw_deg=turn + angle / 2.0, mass_kg=0.1, angle_deg=angle)
        )  # fmt: skip
        turn += angle
    world = empty_world(*pieces)
    let_pass(world, 1.0)
    for prop in world.props.values():
        assert np.hypot(*prop.position[:2]) < 0.006
        assert prop.position[2] == pytest.approx(0.025, abs=0.002)


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"shape": PropShape.compound}, ("parts=[]", "compound")),
        (
            {"size_m": [1, 1, 1], "parts": [PartCfg(PropShape.sphere, [0.1])]},
            ("parts=[PartCfg(", "box"),
        ),
        ({"shape": PropShape.sector, "size_m": [0.1, 0.1], "angle_deg": 200.0}, ("angle_deg=200",)),
        ({"shape": PropShape.convex}, ("points_m=[]", "convex")),
        (
            {"shape": PropShape.convex, "points_m": [[0, 0, 0]] * 4},
            ("points_m", str([[0, 0, 0]] * 4), "plane"),
        ),
    ],
)
def test_impossible_pieces_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming("'thing'", *parts)):
        PropCfg(**({"name": "thing", "size_m": []} | numbers))


def test_parts_are_single_shapes():
    with pytest.raises(ValueError, match=naming("shape=doll", "sphere", "box")):
        PartCfg(PropShape.doll, [0.3])


def test_compounds_and_joints_can_be_written_in_a_configuration():
    leaf = (
        "{name: leaf, shape: compound, mass_kg: 2, "
        "parts: [{shape: box, size_m: [0.1, 1, 2], colour: [1, 0, 0]}, "
        "{shape: pyramid, size_m: [0.1, 0.1, 0.1], rotation_deg: [0, 90, 0]}], "
        "joint: {kind: slide, axis: [0, 1, 0], range_m: 0.4, lock: {key: key}}}"
    )
    points = "[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]"
    key = f"{{name: key, shape: convex, points_m: {points}}}"
    cfg = compose(["+task=KickTheBall", "playground=simple", f"playground.props=[{leaf},{key}]"])
    world = World(cfg.playground)
    assert world.prop("leaf").locked
    assert world.prop("leaf").unlock(world.prop("key"))
    world.close()


def test_a_walker_stops_at_every_part_of_a_fixed_compound():
    posts = [PartCfg(PropShape.box, [0.1, 0.1, 0.5], (0.0, y, 0.25)) for y in (-2.0, 0.0)]
    world = empty_world(PropCfg("posts", PropShape.compound, [], (1.0, 0.0, 0.0), parts=posts))
    walker = walker_in(world)
    for _ in range(60):
        walker.act(walker.encode((1.0, 0.0)))
        world.step()
    assert walker.position[0] == pytest.approx(1.0 - 0.05 - walker.radius_m, abs=0.003)


@pytest.mark.parametrize("shape", ["pyramid", "doll"])
def test_building_prints_nothing(shape, capfd):
    """Without a visual shape Bullet looks for the files of hulls again and warns on the console."""
    sizes = {"pyramid": [0.1, 0.1, 0.1], "doll": [0.2]}
    world = World(PlaygroundCfg())
    world.add_prop(PropCfg(name="thing", shape=PropShape[shape], size_m=sizes[shape], mass_kg=0.1))
    world.close()
    assert "annot find" not in capfd.readouterr().out


@pytest.mark.parametrize(("shape", "folders"), [("box", 0), ("pyramid", 1)])
def test_only_hulls_are_written_to_a_folder(shape, folders, monkeypatch):
    made, make = [], tempfile.TemporaryDirectory
    monkeypatch.setattr(tempfile, "TemporaryDirectory", lambda: made.append(1) or make())
    world = empty_world()
    world.add_prop(PropCfg("thing", PropShape[shape], [0.1, 0.1, 0.1], mass_kg=0.1))
    world.close()
    assert len(made) == folders
