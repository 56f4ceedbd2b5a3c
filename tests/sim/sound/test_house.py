"""Sound between rooms: walls attenuate it, open doors hardly, changes of room do not click."""

import numpy as np
import pytest
import scipy.signal
from composed import compose
from listening import RATE, STEP, make_receiver, ratio_db
from listening import render as render_field
from refusals import naming

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.physics import JointCfg, PropCfg, PropShape, World
from veca_marl.sim.sound import Call, Clip, House, Room, SoundField

WEST = Room((-3.0, -3.0, 0.0), (6.0, 6.0, 2.6), 0.5)
EAST = Room((3.1, -3.0, 0.0), (5.0, 6.0, 2.6), 0.4)
BETWEEN = ((3.05, 0.0, 1.3), np.eye(3), (0.05, 3.0, 1.3))
NOISE = np.random.default_rng(0).standard_normal(12 * STEP).astype(np.float32)
LOSS_DB = 30.0
DOOR = PropCfg(
    "door",
    PropShape.box,
    [0.04, 0.9, 2.0],
    (1.5, 0.0, 1.05),
    mass_kg=1.0,
    joint=JointCfg(axis=(0.0, 0.0, -1.0), anchor_m=(0.02, -0.45, 0.0), range_deg=100.0),
)


def house(*walls, loss_db=LOSS_DB, order=1):
    house = House([WEST, EAST], order, loss_db)
    for wall in walls:
        put_up(house, *wall)
    return house


def put_up(house, centre, rotation, half):
    house.obstacles.move(house.obstacles.add(half), centre, rotation)


def pose(*position):
    return Pose(np.array(position), np.eye(3))


def hear(rooms, source, head, quality="hrtf", sound=NOISE, order=1):
    def place(_):
        return [np.array(source)], head

    return render_field([sound], place, quality, room=rooms, order=order, n_steps=12)


def level_db(heard):
    return 10.0 * np.log10(np.mean(heard[:, 3 * STEP :].astype(float) ** 2))


@pytest.mark.parametrize("quality", ["hrtf", "stereo", "mono"])
def test_inside_one_room_a_house_is_that_room(quality):
    for room, source, head in (
        (WEST, (-2.0, 1.0, 0.5), pose(1.0, -1.0, 1.0)),
        (EAST, (4.0, 1.0, 0.5), pose(7.0, -1.0, 1.0)),
    ):
        alone = render_field(
            [NOISE], lambda _, s=source, h=head: ([np.array(s)], h), quality, room=room,
            order=1, n_steps=12,
        )  # fmt: skip
        in_house = hear(house(BETWEEN), source, head, quality)
        # the blocks of a house have the length that its largest room needs
        assert ratio_db(alone, in_house) > 110.0


@pytest.mark.parametrize("loss_db", [0.0, 10.0, 30.0])
def test_each_wall_attenuates_by_its_loss_at_500_hz(loss_db):
    source, head = (1.0, 0.5, 1.0), pose(5.0, -0.3, 1.0)
    second = ((4.5, 0.0, 1.3), np.eye(3), (0.05, 3.0, 1.3))
    tone = np.sin(2.0 * np.pi * 500.0 * np.arange(12 * STEP) / RATE).astype(np.float32)
    levels = [
        level_db(hear(house(*walls, loss_db=loss_db), source, head, sound=tone))
        for walls in ((), (BETWEEN,), (BETWEEN, second))
    ]
    assert levels[0] - levels[1] == pytest.approx(loss_db, abs=1.0)
    assert levels[0] - levels[2] == pytest.approx(2.0 * loss_db, abs=2.0)


def test_without_a_wall_between_sound_of_another_room_is_that_of_the_free_field():
    source, head = (1.0, 0.5, 1.0), pose(5.0, -0.3, 1.0)
    free = hear(None, source, head)
    through_the_opening = hear(house(order=0), source, head)
    assert ratio_db(free, through_the_opening) > 110.0


def test_a_rotated_wall_attenuates_what_crosses_it():
    c = np.sqrt(0.5)
    turned = np.array([[c, -c, 0.0], [c, c, 0.0], [0.0, 0.0, 1.0]])
    rooms = house(((0.0, 0.0, 1.0), turned, (2.0, 0.05, 1.0)))  # along x = y
    start = np.array([1.0, 0.0, 1.0])
    across, along = (np.array(end) for end in ([0.0, 1.0, 1.0], [0.0, -1.0, 1.0]))
    assert (
        rooms.direct_energy(start, across)[-1] < 0.1 < 0.9 < rooms.direct_energy(start, along)[-1]
    )


def test_a_point_belongs_to_the_room_that_contains_it_or_the_nearest():
    rooms = house()
    places = (0.0, 3.04, 3.06, 3.1, 7.0, 99.0, -99.0)
    assert [rooms.room_of(np.array([x, 0.0, 1.0])) for x in places] == [0, 0, 1, 1, 1, 1, 0]


def test_going_through_a_door_and_behind_a_wall_does_not_click():
    """A 300 Hz tone; what a click would add lies above 2 kHz."""
    beside = ((3.05, -1.5, 1.3), np.eye(3), (0.05, 1.5, 1.3))
    tone = np.sin(2.0 * np.pi * 300.0 * np.arange(60 * STEP) / RATE).astype(np.float32)
    field = SoundField(house(beside), STEP, RATE)
    source = field.add_source("tone", Clip(tone))
    listener = field.add_listener(make_receiver("hrtf"))
    field.reset(np.random.default_rng(0))
    source.position = (1.0, 1.0, 1.0)
    heard, through = [], []
    for step in range(60):
        # through the opening at y = 0.5, then south, behind the wall
        head = pose(min(2.0 + 0.05 * step, 4.0), 0.5 - 0.05 * max(0, step - 40), 1.0)
        ends = np.array(source.position), head.position
        rooms = field_house(field)
        hidden = bool(rooms.direct_energy(*ends)[-1] < 0.5)
        through.append((rooms.room_of(head.position), hidden))
        field.advance()
        heard.append(listener.render(head))
    assert len(set(through)) == 3  # same room, through the opening, behind the wall
    high = scipy.signal.firwin(401, 2000.0, fs=RATE, pass_zero=False)
    sound = np.concatenate(heard, axis=1)[:, 3 * STEP :]
    clicks = np.abs(scipy.signal.lfilter(high, 1.0, sound))[:, 800:].max()
    assert clicks < 10 ** (-60 / 20) * np.abs(sound).max()


def field_house(field):
    return field._surroundings


@pytest.mark.parametrize("wrong", [-1.0, 201.0, 1e308, np.nan, np.inf])
def test_impossible_losses_are_refused(wrong):
    with pytest.raises(ValueError, match="transmission_loss_db"):
        house(loss_db=wrong)
    with pytest.raises(ValueError, match=naming("house", "room")):
        House([])


def test_two_rooms_have_a_door_that_sound_goes_through():
    cfg = compose(["+task=KickTheBall", "playground=two_rooms"]).playground
    world = World(cfg)
    hidden, seen = (
        world.house.direct_energy(np.array([1.0, y, 1.0]), np.array([5.0, y, 1.0]))[-1]
        for y in (-1.0, 1.7)
    )
    assert hidden < 0.1 < 0.9 < seen
    assert [world.house.room_of(np.array([x, 0.0, 1.0])) for x in (0.0, 5.0)] == [0, 1]
    world.close()


def test_a_moving_obstacle_is_heard_while_source_and_listener_are_at_rest():
    rooms = house(BETWEEN)
    field = SoundField(rooms, STEP, RATE)
    field.add_source("noise", Clip(NOISE)).position = (1.0, 0.5, 1.0)
    listener = field.add_listener(make_receiver("mono"))
    field.reset(np.random.default_rng(0))
    levels = []
    for step in range(10):
        if step == 5:
            rooms.obstacles.move(0, (3.05, 0.0, 9.0), np.eye(3))
        field.advance()
        levels.append(10.0 * np.log10(np.mean(listener.render(pose(5.0, 0.0, 1.0)) ** 2) + 1e-12))
    assert levels[8] - levels[4] == pytest.approx(LOSS_DB, abs=2.0)


def test_arrivals_that_are_computed_again_or_reused_give_the_same_bytes():
    heard = []
    for changes_each_step in (False, True):
        rooms = house(BETWEEN)
        field = SoundField(rooms, STEP, RATE)
        source = field.add_source("noise", Clip(NOISE, loop=True))
        listener = field.add_listener(make_receiver("hrtf"))
        field.reset(np.random.default_rng(0))
        for step in range(16):
            source.position = (1.0, 0.5 + 0.02 * (step // 4), 1.0)
            if step == 9:
                source.teleport(source.position)
            if changes_each_step:  # the wall stays where it is, but arrivals are not reused
                rooms.obstacles.changes += 1
            field.advance()
            head = pose(-1.0 + 0.02 * (step // 6), 0.0, 1.0)
            if step == 12:
                continue
            if listener.missed_steps:
                heard.append(listener.rejoin(head))
            heard.append(listener.render(head))
    alike = len(heard) // 2
    assert np.array_equal(np.stack(heard[:alike]), np.stack(heard[alike:]))


def test_an_obstacle_that_is_set_to_its_own_pose_is_no_change():
    obstacles = house(BETWEEN).obstacles
    before = obstacles.changes
    obstacles.move(0, *BETWEEN[:2])
    assert obstacles.changes == before
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for centre, rotation in ((BETWEEN[0], turned), ((3.05, 0.1, 1.3), turned)):
        obstacles.move(0, centre, rotation)
        before += 1
        assert obstacles.changes == before


def test_arrivals_are_computed_once_while_doors_and_everything_else_are_at_rest(monkeypatch):
    world = World(compose(["+task=KickTheBall", "playground=two_rooms"]).playground)
    world.add_prop(DOOR)
    listener = Walker("listener", WalkerCfg(), world)
    ears = AudioSense(AudioCfg(), listener, world)
    source = world.sound.add_source("noise", Clip(NOISE, loop=True))
    world.freeze()
    world.reset(np.random.default_rng(0))
    ears.reset()
    source.teleport((0.5, 0.5, 1.0))
    calls = []
    arrivals = House.arrivals
    monkeypatch.setattr(House, "arrivals", lambda *args: calls.append(1) or arrivals(*args))
    for _ in range(6):
        world.step()
        ears.compute()
    assert len(calls) == 1
    world.prop("door").set_opening(0.5)
    world.step()
    ears.compute()
    assert len(calls) == 2
    world.close()


@pytest.mark.parametrize("half", [(1.0, 1.0), (1.0, 0.0, 1.0), (1.0, np.nan, 1.0)])
def test_impossible_obstacles_are_refused(half):
    with pytest.raises(ValueError, match=naming(f"half={half}")):
        house().obstacles.add(half)


def test_a_walker_in_the_next_room_hears_a_voice_through_the_door_or_through_the_wall():
    world = World(compose(["+task=KickTheBall", "playground=two_rooms"]).playground)
    speaker, friend = (Walker(name, WalkerCfg(), world) for name in ("speaker", "friend"))
    ears = AudioSense(AudioCfg(waveform=True), friend, world)
    world.freeze()
    loudest = []
    for y in (-1.0, 1.7):
        world.reset(np.random.default_rng(0))
        ears.reset()
        speaker.place((1.0, y, 0.0))
        friend.place((5.0, y, 0.0), np.pi)
        speaker.call(Call.high)
        for _ in range(8):
            world.step()
            loudest.append(np.abs(ears.read()["waveform"]).max())
    world.close()
    wall, door = max(loudest[:8]), max(loudest[8:])
    # behind the wall what comes round the edge of the door is louder than what passes the wall
    assert 10.0 < 20.0 * np.log10(door / wall) < 33.0
