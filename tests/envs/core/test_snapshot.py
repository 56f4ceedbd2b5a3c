"""Snapshots of what Bullet and Python keep apart, refusals, and damaged files."""

import collections
import io
import json
import math
import zipfile

import numpy as np
import pytest
from rollouts import game_cfg

from veca_marl.envs.core.built_objects import BuiltObjects
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.object_states import Capture
from veca_marl.envs.core.snapshot import Snapshot, SnapshotError, Snapshots, restore
from veca_marl.sim.physics.bullet_state import saved_state, solving_order

TASK = "BabyzumasRevenge"


@pytest.fixture(scope="module")
def game():
    game = Game(game_cfg(TASK))
    yield game
    game.close()


@pytest.fixture(scope="module")
def snapshots(game):
    return Snapshots(game)


@pytest.fixture
def begun(game):
    game.world.client.setGravity(0.0, 0.0, -9.81)
    game.reset(np.random.default_rng(0))
    let_pass(game, 3)
    return game


def let_pass(game, steps):
    """Play some steps standing still; return what eyes, ears and physics were after each."""
    seen = []
    for _ in range(steps):
        for player in game.actors:
            player.body.rest()
        game.advance()
        values = [value.tobytes() for player in game.players for value in _senses(game, player)]
        poses = game.world.scene.positions.tobytes() + game.world.scene.rotations.tobytes()
        seen.append((poses, *values))
    return seen


def _senses(game, player):
    return [value for _, value in sorted(game.observe(player).items())]


def taken(game, snapshots):
    return snapshots.take(game, Episodes(0).state)


def check_it_continues(game, snapshots, meanwhile, steps=12):
    """Check that what follows is the same after something else was done meanwhile."""
    snapshot = taken(game, snapshots)
    went_on = let_pass(game, steps)
    meanwhile()
    restore(game, snapshot)
    assert let_pass(game, steps) == went_on


def light(game):
    body = game.players[0].body
    return next(p for p in game.world.props.values() if body.can_grab(p))


def hinged(game):
    doors = [p for p in game.world.props.values() if p.joint is not None and not p.joint.locked]
    return doors[0]


def test_a_held_thing_is_held_again(begun, snapshots):
    body, toy = begun.players[0].body, light(begun)
    assert body.grab(toy)
    let_pass(begun, 2)

    def release():
        assert body.release()
        let_pass(begun, 5)
        assert body.held is None

    check_it_continues(begun, snapshots, release)
    assert body.held is toy
    assert toy.holder == body.name


def test_what_was_held_in_an_episode_does_not_change_later_ones(begun):
    def played():
        begun.reset(np.random.default_rng(3))
        return solving_order(saved_state(begun.world.client)), let_pass(begun, 30)

    first = played()
    body, toy = begun.players[0].body, light(begun)
    assert body.grab(toy)
    let_pass(begun, 3)
    assert body.release()
    let_pass(begun, 3)
    assert played() == first


def test_what_was_free_is_free_again(begun, snapshots):
    body, toy = begun.players[0].body, light(begun)

    def grab():
        assert body.grab(toy)
        let_pass(begun, 5)

    check_it_continues(begun, snapshots, grab)
    assert body.held is None
    assert toy.holder is None


def test_a_door_that_moves_goes_on(begun, snapshots):
    door = hinged(begun)
    assert door.joint.drive(1.0 if door.joint.opening < 0.5 else 0.0)
    let_pass(begun, 2)
    assert door.joint.driven
    check_it_continues(begun, snapshots, lambda: door.joint.set_opening(0.3))


def test_a_door_that_rests_rests_again(begun, snapshots):
    door = hinged(begun)
    check_it_continues(begun, snapshots, lambda: door.joint.drive(1.0))
    assert not door.joint.driven


def test_things_sleep_again(begun, snapshots):
    let_pass(begun, 30)
    check_it_continues(
        begun, snapshots, lambda: [p.rest.wake() for p in begun.world.props.values()]
    )


def test_what_was_awake_does_not_sleep(begun, snapshots):
    check_it_continues(begun, snapshots, lambda: let_pass(begun, 30))


def test_other_episodes_in_between_change_nothing(begun, snapshots):
    def play():
        for seed in (1, 2):
            begun.reset(np.random.default_rng(seed))
            let_pass(begun, 4)

    check_it_continues(begun, snapshots, play)


def test_gravity_is_restored(begun, snapshots):
    begun.world.client.setGravity(0.0, 0.0, -1.6)
    check_it_continues(begun, snapshots, lambda: begun.world.client.setGravity(0.0, 0.0, -9.81))
    assert begun.world.client.gravity() == (0.0, 0.0, -1.6)


def test_a_thousand_branches_take_no_memory_in_bullet(begun, snapshots):
    snapshot = taken(begun, snapshots)
    first = None
    for _ in range(5):
        restore(begun, snapshot)
        seen = let_pass(begun, 2)
        first = first or seen
        assert seen == first


def test_before_the_first_episode_there_is_nothing_to_snapshot(snapshots):
    other = Game(game_cfg(TASK))
    with pytest.raises(RuntimeError):
        taken(other, snapshots)
    other.close()


@pytest.mark.parametrize("override", ["task.max_seconds=7", "senses.audio.bins=40"])
def test_another_configuration_is_refused(begun, snapshots, override):
    snapshot = taken(begun, snapshots)
    other = Game(game_cfg(TASK, "own", override))
    other.reset(np.random.default_rng(0))
    before = other.world.scene.positions.copy()
    with pytest.raises(SnapshotError):
        restore(other, snapshot)
    np.testing.assert_array_equal(other.world.scene.positions, before)
    other.close()


class Holder:
    """A root with one attribute."""

    def __init__(self):
        self.held = None


@pytest.mark.parametrize(
    "held",
    [(n for n in range(3)), iter([1]), io.StringIO("text"), np.array([object()])],
    ids=["generator", "iterator", "stream", "objects"],
)
def test_what_is_no_data_is_refused(held):
    root = Holder()
    built = BuiltObjects(root)
    root.held = held
    with pytest.raises(SnapshotError):
        Capture(built, frozenset()).states()


def test_a_stored_snapshot_is_equal(begun, snapshots, tmp_path):
    snapshot = taken(begun, snapshots)
    snapshot.save(tmp_path / "a.veca")
    went_on = let_pass(begun, 10)
    restore(begun, Snapshot.load(tmp_path / "a.veca"))
    assert let_pass(begun, 10) == went_on
    assert [path.name for path in tmp_path.iterdir()] == ["a.veca"]


def _rewritten(source, target, change):
    """Write an archive with a changed structure."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "structure.json":
                structure = json.loads(content)
                change(structure)
                content = json.dumps(structure)
            other.writestr(name, content)


def _no_made(structure):
    structure["made"] = structure["made"][:2]


def _other_format(structure):
    structure["format"] = 99


def _foreign_class(structure):
    structure["made"] = [["object", "subprocess:Popen", []] for _ in structure["made"]]


def _foreign_function(structure):
    structure["made"] = [["list", [["class", "os:system"]]] for _ in structure["made"]]


def _numbers_beyond(structure):
    structure["built"] = [[10**9, each] for _, each in structure["built"]]


def _wrong_kinds(structure):
    structure["built"] = [[number, ["nonsense"]] for number, _ in structure["built"]]
    structure["made"] = [["nonsense"] for _ in structure["made"]]


def _other_random(structure):
    state = ["random", ["dict", [["bit_generator", "seed"]]]]
    structure["made"] = [state if each[0] == "random" else each for each in structure["made"]]


def _addresses(structure):
    view = ["view", ["built", 0], 0, ["|O", [1], [8]], True]
    structure["made"] = [view for _ in structure["made"]]


def _property(structure):
    structure["made"] = [["method", ["built", 0], "weights"] for _ in structure["made"]]


def _negative_episode(structure):
    structure["episodes"] = [0, 0, -1]


def _imported_class(structure):
    name = "veca_marl.envs.core.snapshot:tempfile._TemporaryFileCloser"
    structure["made"].append(["object", name, []])


def _imported_function(structure):
    value = ["class", "veca_marl.envs.core.snapshot:os.replace"]
    structure["made"].append(["list", [value]])


def _function_of_the_game(structure):
    value = ["class", "veca_marl.envs.core.snapshot:restore"]
    structure["made"].append(["list", [value]])


def _shadowed_method(structure):
    (task,) = [c for _, c in structure["built"] if c[0] == "object" and c[1].endswith(f":{TASK}")]
    structure["made"].append(["method", ["built", 0], "reset"])
    task[2].append(["terminated", ["made", len(structure["made"]) - 1]])


def _class_of_another_part(structure):
    structure["made"].append(["object", "veca_marl.stored_files:StoredFileError", []])


def _method_of_a_class_that_was_not_built(structure):
    structure["made"].append(["object", "veca_marl.envs.core.snapshot:Snapshot", []])
    structure["made"].append(["method", ["made", len(structure["made"]) - 1], "save"])


def _class_as_enumeration(structure):
    structure["made"].append(["list", [["enum", "veca_marl.envs.core.game:Game", "x"]]])


def _one_array_twice(structure):
    array = next(content for _, content in structure["built"] if content[0] == "array")
    structure["made"].append(array)


def _no_digest(structure):
    del structure["digest"]


@pytest.mark.parametrize(
    "change",
    [_no_made, _other_format, _foreign_class, _foreign_function, _numbers_beyond, _wrong_kinds,
     _no_digest, _other_random, _addresses, _property, _negative_episode, _imported_class,
     _class_of_another_part, _method_of_a_class_that_was_not_built,
     _imported_function, _function_of_the_game, _shadowed_method, _class_as_enumeration,
     _one_array_twice],
)  # fmt: skip
def test_altered_files_are_refused_in_one_line(begun, snapshots, tmp_path, change):
    taken(begun, snapshots).save(tmp_path / "a.veca")
    _rewritten(tmp_path / "a.veca", tmp_path / "b.veca", change)
    before = begun.world.scene.positions.copy()
    with pytest.raises(SnapshotError) as refusal:
        restore(begun, Snapshot.load(tmp_path / "b.veca"))
    assert "\n" not in str(refusal.value)
    np.testing.assert_array_equal(begun.world.scene.positions, before)
    let_pass(begun, 2)


def test_damaged_files_are_refused(begun, snapshots, tmp_path):
    path = tmp_path / "a.veca"
    taken(begun, snapshots).save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for content in (b"", b"PK", whole[: len(whole) // 2], rng.bytes(5000)):
        path.write_bytes(content)
        with pytest.raises(SnapshotError):
            Snapshot.load(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("structure.json", "0" * 10**7)
    with pytest.raises(SnapshotError):
        Snapshot.load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("structure.json", "[" * 200_000)
    with pytest.raises(SnapshotError):
        Snapshot.load(path)
    with pytest.raises(SnapshotError):
        Snapshot.load(tmp_path / "missing.veca")


def test_an_array_that_says_that_it_is_larger_takes_no_memory(begun, snapshots, tmp_path):
    taken(begun, snapshots).save(tmp_path / "a.veca")
    header = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    np.lib.format.write_array_header_1_0(header, claim)
    with (
        zipfile.ZipFile(tmp_path / "a.veca") as archive,
        zipfile.ZipFile(tmp_path / "b.veca", "w") as other,
    ):
        for name in archive.namelist():
            content = header.getvalue() if name == "0.npy" else archive.read(name)
            other.writestr(name, content)
    with pytest.raises(SnapshotError):
        Snapshot.load(tmp_path / "b.veca")


def break_simulation(game):
    """Let the pose of the ball become infinite; the step in which it does ends the episode."""
    nan = [math.nan] * 3
    game.world.client.resetBaseVelocity(game.world.prop("ball").body_id, nan, nan)
    for player in game.actors:
        player.body.rest()
    assert game.advance().truncated


def test_after_a_broken_simulation_it_continues_as_in_a_new_game():
    game = Game(game_cfg("KickTheBall"))
    snapshots = Snapshots(game)
    game.reset(np.random.default_rng(1))
    let_pass(game, 3)
    snapshot = taken(game, snapshots)
    went_on = let_pass(game, 10)
    break_simulation(game)
    with pytest.raises(RuntimeError):
        taken(game, snapshots)
    restore(game, snapshot)
    assert let_pass(game, 10) == went_on
    game.reset(np.random.default_rng(1))
    assert let_pass(game, 13)[3:] == went_on
    break_simulation(game)
    game.reset(np.random.default_rng(1))
    let_pass(game, 3)
    restore(game, snapshot)
    assert taken(game, snapshots).built == snapshot.built
    assert let_pass(game, 10) == went_on
    game.close()


@pytest.mark.parametrize("kind", [collections.OrderedDict, collections.Counter])
def test_mappings_of_other_kinds_are_refused(kind):
    root = Holder()
    built = BuiltObjects(root)
    root.held = kind(a=1)
    with pytest.raises(SnapshotError):
        Capture(built, frozenset()).states()


def test_one_flipped_bit_is_found(begun, snapshots, tmp_path):
    path = tmp_path / "a.veca"
    taken(begun, snapshots).save(path)
    with zipfile.ZipFile(path) as archive:
        middles = {
            each.filename: each.header_offset + 30 + len(each.filename) + each.file_size // 2
            for each in archive.infolist()
        }
    whole = path.read_bytes()
    for name in ("structure.json", "physics.bullet", "0.npy"):
        at = middles[name]
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        with pytest.raises(SnapshotError):
            Snapshot.load(path)
