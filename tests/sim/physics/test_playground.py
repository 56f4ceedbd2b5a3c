"""Playgrounds as data: the shipped ones are stable, impossible ones are refused."""

import math

import numpy as np
import pytest
from composed import compose
from refusals import naming
from walking import ball, let_pass, walker_in

from veca_marl.config import conf_dir
from veca_marl.sim.physics import JointKind, PlaygroundCfg, RoomCfg, World

SHIPPED = sorted(path.stem for path in (conf_dir() / "playground").glob("*.yaml"))


@pytest.fixture(scope="module", params=SHIPPED)
def playground(request):
    return compose(["+task=KickTheBall", f"playground={request.param}"]).playground


def test_its_name_is_that_of_its_file(playground):
    assert playground.name in SHIPPED


def test_its_props_stay_at_rest(playground):
    """Nothing overlaps, floats or falls over in 3 s."""
    world = World(playground)
    before = world.scene.positions.copy()
    let_pass(world, 3.0)
    np.testing.assert_allclose(world.scene.positions, before, atol=0.005)


def test_its_props_are_inside_its_rooms(playground):
    world = World(playground)
    for name, prop in world.props.items():
        if prop.joint is not None and prop.joint.cfg.kind is JointKind.slide:
            away_m = min(room.distance_m(prop.position[:2]) for room in playground.rooms)
            assert away_m <= playground.walls.thickness_m, "in the wall beside its opening"
        elif not name.startswith("wall"):
            assert any(room.contains(prop.position) for room in playground.rooms), name


def test_a_walker_cannot_leave_it(playground):
    world = World(playground)
    walker = walker_in(world)
    for yaw_deg in range(0, 360, 45):
        walker.place((0.0, 0.0, 0.0), math.radians(yaw_deg))
        walker.walk(1.0, 0.0)
        let_pass(world, 6.0)
        ends = [room.distance_m(walker.position[:2]) for room in playground.rooms]
        assert min(ends) <= 0.05, "in a room, or in a door between two"


def test_a_room_knows_what_is_inside():
    room = RoomCfg(lower_m=(1.0, 2.0, 0.0), size_m=(3.0, 4.0, 2.5))
    assert room.contains(np.array([1.1, 5.9, 0.1]))
    assert not room.contains(np.array([0.9, 3.0, 1.0]))
    assert not room.contains(np.array([1.1, 5.9, 0.1]), margin_m=0.2)


def test_floor_points_keep_their_distance_from_the_walls():
    room = RoomCfg(lower_m=(1.0, 2.0, 0.5), size_m=(3.0, 4.0, 2.5))
    rng = np.random.default_rng(0)
    points = np.array([room.sample_floor(rng, margin_m=1.0) for _ in range(500)])
    assert (points[:, 2] == 0.5).all()
    np.testing.assert_allclose(points.min(axis=0)[:2], (2.0, 3.0), atol=0.05)
    np.testing.assert_allclose(points.max(axis=0)[:2], (3.0, 5.0), atol=0.05)


def test_a_margin_may_not_be_wider_than_the_room():
    with pytest.raises(ValueError, match=r"'closet'.*2\.0 m"):
        RoomCfg(name="closet", size_m=(3.0, 6.0, 2.5)).sample_floor(np.random.default_rng(0), 2.0)


@pytest.mark.parametrize("wrong", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, math.nan)])
def test_impossible_sizes_are_refused(wrong):
    with pytest.raises(ValueError, match=naming("'attic'", "size_m")):
        RoomCfg(name="attic", size_m=wrong)


@pytest.mark.parametrize("wrong", [-0.1, 1.0, math.nan])
def test_impossible_echoes_are_refused(wrong):
    with pytest.raises(ValueError, match="reflection"):
        RoomCfg(reflection=wrong)


def test_positions_of_rooms_must_be_finite():
    with pytest.raises(ValueError, match="lower_m"):
        RoomCfg(lower_m=(0.0, math.inf, 0.0))


def test_impossible_playgrounds_are_refused():
    with pytest.raises(ValueError, match=naming("'void'", "room")):
        PlaygroundCfg(name="void", rooms=[])
    with pytest.raises(ValueError, match=naming("'twins'", "props", "['ball']")):
        PlaygroundCfg(name="twins", props=[ball(), ball()])
    with pytest.raises(ValueError, match="image_order=-1"):
        PlaygroundCfg(name="early", image_order=-1)


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"image_order": 1000}, ("image_order=1000", "12")),
        ({"image_order": 1.5}, ("image_order=1.5",)),
        ({"image_order": math.inf}, ("image_order=inf",)),
        ({"floor_colour": (1.2, 0.5, 0.5)}, ("floor_colour=(1.2, 0.5, 0.5)",)),
        ({"floor_colour": (0.5, 0.5)}, ("floor_colour=(0.5, 0.5)",)),
        ({"floor_checker_m": -0.5}, ("floor_checker_m=-0.5",)),
        ({"floor_size_m": (0.0, 6.0)}, ("floor_size_m=(0.0, 6.0)",)),
        ({"floor_centre_m": (math.nan, 0.0)}, ("floor_centre_m=(nan, 0.0)",)),
        ({"rooms": [RoomCfg(), RoomCfg(lower_m=(5.0, 0.0, 0.0))]}, ("rooms", "['room']")),
        ({"rooms": [RoomCfg(), RoomCfg(name="b")]}, ("'room'", "'b'", "93.6 m3")),
        (
            {"rooms": [RoomCfg(), RoomCfg(name="b", lower_m=(2.9, 0.0, 0.0))]},
            ("'room'", "'b'", "0.78 m3"),
        ),
    ],
)
def test_numbers_out_of_range_are_refused_by_name(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        PlaygroundCfg(name="odd", **numbers)


def test_rooms_may_touch():
    above = RoomCfg(name="attic", lower_m=(-3.0, -3.0, 2.6))
    beside = RoomCfg(name="bedroom", lower_m=(3.0, -3.0, 0.0))
    playground = PlaygroundCfg(name="house", rooms=[RoomCfg(), above, beside])
    assert len(playground.rooms) == 3


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ({"colour": (0.5, 0.5, 255.0)}, "colour=(0.5, 0.5, 255.0)"),
        ({"colour": (0.5, 0.5, math.nan)}, "colour=(0.5, 0.5, nan)"),
        ({"checker_m": -0.1}, "checker_m=-0.1"),
    ],
)
def test_an_impossible_appearance_of_a_prop_is_refused(numbers, named):
    with pytest.raises(ValueError, match=naming("prop 'ball'", named)):
        ball(**numbers)


def test_an_impossible_room_on_the_command_line_is_one_line():
    with pytest.raises(ValueError, match="image_order"):
        compose(["+task=KickTheBall", "playground.image_order=-1"])


def test_a_start_faces_the_middle():
    room = RoomCfg(lower_m=(1.0, 2.0, 0.0), size_m=(4.0, 6.0, 2.0))
    rng = np.random.default_rng(0)
    starts = [room.sample_start(rng, margin_m=0.5) for _ in range(20)]
    for point, heading in starts:
        ahead = 1.5 * np.array([math.cos(heading), math.sin(heading), 0.0])
        np.testing.assert_allclose(point + ahead, (3.0, 5.0, 0.0), atol=1e-12)
        assert room.contains(point + np.array([0.0, 0.0, 1.0]), margin_m=0.5 - 1e-9)
    assert np.ptp([heading for _, heading in starts]) > 3.0


def test_a_start_needs_a_room_of_some_size():
    with pytest.raises(ValueError, match=naming("size_m=(1.0, 1.0, 1.0)", "0.6 m")):
        RoomCfg(size_m=(1.0, 1.0, 1.0)).sample_start(np.random.default_rng(0), margin_m=0.6)
