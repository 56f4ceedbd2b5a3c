"""The `voice` part of an action: what is chosen, what is heard, and what is refused."""

import numpy as np
import pytest
from refusals import naming
from walking import empty_world, walker_in

from veca_marl.sim.body import VoiceKind
from veca_marl.sim.body.humanoid import JointActionKind, JointCommand
from veca_marl.sim.body.walker.actions import MOVES, WalkActionKind
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.sound import Call

STILL = np.zeros(2, np.float32)
CALLS_SPEC = ((), np.int64, 0, 4)


def spec_of(part):
    return part.shape, part.dtype, part.low, part.high


@pytest.mark.parametrize("kind", WalkActionKind)
def test_a_walker_has_a_discrete_voice_beside_its_movement(kind):
    silent = walker_in(empty_world(), action=kind).action_spec
    calling = walker_in(empty_world(), action=kind, voice=VoiceKind.calls).action_spec
    assert list(silent) == ["move"]
    assert list(calling) == ["move", "voice"]
    assert calling["move"] == silent["move"]
    assert spec_of(calling["voice"]) == CALLS_SPEC
    assert calling["voice"].names == tuple(call.name for call in Call)


@pytest.mark.parametrize("kind", WalkActionKind)
@pytest.mark.parametrize("call", Call)
def test_a_walkers_command_is_encoded_part_by_part(kind, call):
    walker = walker_in(empty_world(), action=kind, voice=VoiceKind.calls)
    silent = walker_in(empty_world(), action=kind)
    for forward, turn in MOVES.values():
        action = walker.encode((forward, turn, call))
        assert list(action) == ["move", "voice"]
        assert action["voice"] == call
        assert action["voice"].dtype == np.int64
        np.testing.assert_array_equal(action["move"], silent.encode((forward, turn))["move"])
        assert walker.encode((forward, turn))["voice"] == Call.none
        assert list(silent.encode((forward, turn, call))) == ["move"]


@pytest.mark.parametrize(
    "voice", [np.array(5), np.array(-1), np.array(1.0), np.array([1]), np.array(True), None]
)
def test_an_impossible_call_is_refused_with_the_choices_and_nothing_moves(voice):
    world = empty_world()
    walker = walker_in(world, voice=VoiceKind.calls)
    with pytest.raises(ValueError, match=naming("'voice'", "'none'", "'falling'")):
        walker.act({"move": np.ones(2), "voice": voice})
    before = walker.position
    world.step()
    np.testing.assert_array_equal(walker.position[:2], before[:2])


@pytest.mark.parametrize("parts", [["move"], ["voice"], [], ["move", "voice", "verb"]])
def test_all_parts_and_no_others_are_needed(parts):
    walker = walker_in(empty_world(), voice=VoiceKind.calls)
    action = {part: np.array(0) if part == "voice" else STILL for part in parts}
    with pytest.raises(ValueError, match=naming("['move', 'voice']")):
        walker.act(action)


def test_a_body_needs_a_mapping():
    with pytest.raises(ValueError, match=naming("mapping", "['move']")):
        walker_in(empty_world()).act(STILL)


def test_an_unknown_voice_is_refused_with_the_choices():
    with pytest.raises(ValueError, match=r"body\.voice.*silent.*calls"):
        walker_in(empty_world(), voice="loud")


def loudness_at(place, call, steps=12):
    """Return what speaker and listener hear, ``(2, steps)`` rms, with a call at every step."""
    world = empty_world()
    speaker = walker_in(world, voice=VoiceKind.calls)
    listener = walker_in(world, "listener", place, voice=VoiceKind.calls)
    senses = [AudioSense(AudioCfg(waveform=True), one, world) for one in (speaker, listener)]
    heard = []
    for _ in range(steps):
        speaker.act({"move": STILL, "voice": np.array(call)})
        listener.act({"move": STILL, "voice": np.array(Call.none)})
        world.step()
        heard.append([np.sqrt(np.mean(sense.read()["waveform"] ** 2)) for sense in senses])
    world.close()
    return np.array(heard).T


def test_a_call_is_heard_by_the_speaker_and_weaker_and_later_by_others():
    own, near = loudness_at((2.0, 0.0, 0.0), Call.high)
    far = loudness_at((16.0, 0.0, 0.0), Call.high)[1]
    assert own.max() > 3.0 * near.max() > 12.0 * far.max() > 0.0
    first = [int(np.flatnonzero(heard > 1e-6)[0]) for heard in (own, near, far)]
    assert first == [0, 0, 1]  # sound takes 47 ms for 16 m


def test_the_call_none_is_silent():
    assert not loudness_at((2.0, 0.0, 0.0), Call.none).any()


def test_a_call_is_played_to_its_end_and_later_ones_are_not_queued():
    """Chosen at every step during three calls, it ends at most one call after the last choice."""
    world = empty_world()
    walker = walker_in(world, voice=VoiceKind.calls)
    for call, steps in ((Call.high, 15), (Call.none, 5)):
        for _ in range(steps):
            walker.act({"move": STILL, "voice": np.array(call)})
            world.step()
    assert not walker._voice.speaking


@pytest.mark.parametrize(("pause_s", "calls"), [(0.0, 7), (0.5, 2), (2.0, 1)])
def test_a_call_is_followed_by_its_pause(pause_s, calls):
    """A call of 0.2 s is chosen at each of 34 steps of 40 ms."""
    world = empty_world()
    walker = walker_in(world, voice=VoiceKind.calls, call_pause_s=pause_s)
    begun = 0
    for _ in range(34):
        begun += not walker._voice.speaking
        walker.act({"move": STILL, "voice": np.array(Call.high)})
        world.step()
    assert begun == calls


def test_the_pause_is_silent_and_ends_with_the_episode():
    world = empty_world()
    walker = walker_in(world, voice=VoiceKind.calls, call_pause_s=1.0)
    world.freeze()
    ear, heard = AudioSense(AudioCfg(waveform=True), walker, world), []
    for _ in range(20):
        walker.act({"move": STILL, "voice": np.array(Call.high)})
        world.step()
        heard.append(np.abs(ear.read()["waveform"]).max())
    assert min(heard[:5]) > 1e-3
    assert max(heard[10:]) < 1e-6
    world.reset(np.random.default_rng(0))
    assert not walker._voice.speaking


@pytest.mark.parametrize("pause_s", [-0.1, np.inf, 60.1])
def test_an_impossible_pause_is_refused(pause_s):
    with pytest.raises(ValueError, match=r"body\.call_pause_s"):
        walker_in(empty_world(), voice=VoiceKind.calls, call_pause_s=pause_s)


# ---- joint-level bodies


@pytest.mark.parametrize("action", JointActionKind)
def test_a_joint_level_body_has_a_voice_and_moves_its_joints_as_without(make_child, action):
    wanted = np.zeros(82)
    wanted[5] = 0.2
    _, silent = make_child(action=action)
    _, calling = make_child(action=action, voice=VoiceKind.calls)
    assert list(silent.action_spec) == ["joints"]
    assert spec_of(calling.action_spec["voice"]) == CALLS_SPEC
    without = silent.encode(JointCommand(wanted, horizon_s=0.0, call=Call.rising))
    for call in Call:
        encoded = calling.encode(JointCommand(wanted, horizon_s=0.0, call=call))
        np.testing.assert_array_equal(encoded["joints"], without["joints"])
        assert encoded["voice"] == call
    assert list(without) == ["joints"]
    assert calling.encode(wanted)["voice"] == Call.none


def test_a_joint_level_body_calls_and_its_torques_alone_are_silent(make_child):
    world, child = make_child(voice=VoiceKind.calls)
    ear = AudioSense(AudioCfg(waveform=True), child, world)

    def heard():
        world.step()
        return np.abs(ear.read()["waveform"]).max()

    child.act({"joints": np.zeros(82), "voice": np.array(Call.none)})
    assert heard() == 0.0
    child.apply_torque(np.zeros(82))
    assert heard() == 0.0
    child.act({"joints": np.zeros(82), "voice": np.array(Call.low)})
    assert heard() > 0.0


def test_an_impossible_call_moves_no_joint(make_child):
    world, child = make_child(voice=VoiceKind.calls)
    with pytest.raises(ValueError, match=naming("'voice'", "array(5)")):
        child.act({"joints": np.ones(82), "voice": np.array(5)})
    world.step()
    assert not child.joint_torques().any()
