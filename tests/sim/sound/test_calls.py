"""Calls: their pitch, their rows, and who hears them."""

import itertools

import numpy as np
import pytest
from walking import empty_world, walker_in

from veca_marl.sim.body.humanoid.humanoid import JointActionKind
from veca_marl.sim.body.humanoid.joint_controls import Springs
from veca_marl.sim.body.voice_controls import BANDS, CallNumber, VoiceKind, action_control
from veca_marl.sim.body.walker.controls import MOVES, ActionKind
from veca_marl.sim.hearing.sense import AudioCfg, AudioSense
from veca_marl.sim.sound.calls import CALLS, Call, CallCfg, call_waveform

RATE = 22_050
SPOKEN = list(CALLS)


def pitch_hz(samples):
    """From the autocorrelation, between 200 and 800 Hz."""
    correlation = np.correlate(samples, samples, "full")[len(samples) - 1 :]
    lags = np.arange(RATE // 800, RATE // 200)
    return RATE / lags[np.argmax(correlation[lags])]


@pytest.mark.parametrize("call", SPOKEN)
def test_the_pitch_goes_from_the_beginning_to_the_end(call):
    cfg = CALLS[call]
    samples = call_waveform(cfg, RATE)
    assert len(samples) == round(cfg.length_s * RATE)
    tenth = len(samples) // 10
    assert pitch_hz(samples[tenth : 2 * tenth]) == pytest.approx(
        cfg.begin_hz * (cfg.end_hz / cfg.begin_hz) ** 0.15, rel=0.06
    )
    assert pitch_hz(samples[-2 * tenth : -tenth]) == pytest.approx(
        cfg.begin_hz * (cfg.end_hz / cfg.begin_hz) ** 0.85, rel=0.06
    )


@pytest.mark.parametrize("call", SPOKEN)
def test_a_call_has_its_level_and_begins_and_ends_in_silence(call):
    samples = call_waveform(CALLS[call], RATE)
    assert np.sqrt(np.mean(samples.astype(float) ** 2)) == pytest.approx(0.1, rel=0.1)
    assert abs(samples[0]) < 1e-3
    assert abs(samples[-1]) < 1e-3
    assert not samples.flags.writeable


@pytest.mark.parametrize(
    "wrong", [{"begin_hz": 10.0}, {"end_hz": np.nan}, {"length_s": 0.0}, {"level": -1.0}]
)
def test_impossible_calls_are_refused(wrong):
    with pytest.raises(ValueError, match=r"frequency_hz|length_s|level"):
        CallCfg(**{"begin_hz": 300.0, "end_hz": 300.0, **wrong})


@pytest.mark.parametrize("kind", ActionKind)
@pytest.mark.parametrize("call", Call)
def test_a_row_is_decoded_to_the_wish_it_was_made_from(kind, call):
    control = action_control(kind, VoiceKind.calls)
    for move in MOVES.values():
        row = control.encode(*move, call)
        assert row.shape == control.spec.shape
        assert row.dtype == control.spec.dtype
        assert control.decode(row) == (*move, call)


def test_all_rows_of_the_discrete_walk_are_different_and_the_silent_ones_the_old():
    control = action_control(ActionKind.discrete, VoiceKind.calls)
    decoded = [control.decode(np.array(row)) for row in range(int(control.spec.high) + 1)]
    assert len(set(decoded)) == len(decoded) == len(MOVES) * len(Call)
    silent = action_control(ActionKind.discrete, VoiceKind.silent)
    for row in range(len(MOVES)):
        assert decoded[row] == silent.decode(np.array(row))


def test_bands_are_equally_wide_and_silence_is_in_the_middle():
    control = action_control(ActionKind.continuous, VoiceKind.calls)
    numbers = np.linspace(-1.0, 1.0, 1001)
    heard = [control.decode(np.array([0.0, 0.0, number]))[2] for number in numbers]
    assert heard[500] is Call.none
    assert tuple(call for call, _ in itertools.groupby(heard)) == BANDS
    for call in Call:
        assert heard.count(call) == pytest.approx(200, abs=1)


@pytest.mark.parametrize(
    ("kind", "row"),
    [
        (ActionKind.continuous, np.array([0.0, 0.0])),
        (ActionKind.continuous, np.array([0.0, 0.0, np.nan])),
        (ActionKind.continuous, np.array([0.0, 0.0, 1.01])),
        (ActionKind.discrete, np.array(35)),
        (ActionKind.discrete, np.array(-1)),
        (ActionKind.discrete, np.array(1.5)),
    ],
)
def test_impossible_rows_are_refused(kind, row):
    walker = walker_in(empty_world(), action=kind, voice=VoiceKind.calls)
    with pytest.raises(ValueError, match="action"):
        walker.act(row)


def test_an_unknown_voice_is_answered_with_those_there_are():
    with pytest.raises(ValueError, match=r"body\.voice.*silent.*calls"):
        walker_in(empty_world(), voice="loud")


def heard_by(place, row, steps=12, friend_row=None):
    """What speaker and friend hear, ``(2, steps)`` rms, when the row is given at every step."""
    world = empty_world()
    speaker = walker_in(world, voice=VoiceKind.calls)
    friend = walker_in(world, "friend", place, voice=VoiceKind.calls)
    senses = [AudioSense(AudioCfg(waveform=True), one, world) for one in (speaker, friend)]
    quiet = np.zeros(3, np.float32)
    heard = []
    for _ in range(steps):
        speaker.act(row)
        friend.act(quiet if friend_row is None else friend_row)
        world.step()
        heard.append([np.sqrt(np.mean(sense.read()["waveform"] ** 2)) for sense in senses])
    world.close()
    return np.array(heard).T


def test_a_caller_is_heard_by_itself_and_weaker_and_later_by_others():
    own, near = heard_by((2.0, 0.0, 0.0), np.array([0.0, 0.0, 1.0]))
    far = heard_by((16.0, 0.0, 0.0), np.array([0.0, 0.0, 1.0]))[1]
    assert own.max() > 3.0 * near.max() > 12.0 * far.max() > 0.0
    first = [int(np.flatnonzero(heard > 1e-6)[0]) for heard in (own, near, far)]
    assert first == [0, 0, 1]  # 16 m are 47 ms


def test_silence_is_silent():
    assert not heard_by((2.0, 0.0, 0.0), np.zeros(3)).any()


def test_a_call_is_called_to_its_end_and_not_queued():
    """Called at every step for as long as three calls, it is over one call later at most."""
    world = empty_world()
    walker = walker_in(world, voice=VoiceKind.calls)
    for _ in range(15):
        walker.act(np.array([0.0, 0.0, 1.0]))
        world.step()
    for _ in range(5):
        walker.act(np.zeros(3))
        world.step()
    assert not walker._voice.speaking


# ---- joint by joint


@pytest.mark.parametrize("action", JointActionKind)
def test_a_joint_level_row_ends_with_the_call_and_moves_the_joints_as_without(make_child, action):
    wanted = np.zeros(82)
    wanted[5] = 0.2
    _, silent = make_child(action=action)
    _, calling = make_child(action=action, voice=VoiceKind.calls)
    row = silent.encode(Springs(wanted, ahead_s=0.0, call=Call.rising))
    for call in Call:
        longer = calling.encode(Springs(wanted, ahead_s=0.0, call=call))
        assert (longer.shape, longer.dtype) == (calling.action_spec.shape, np.float32)
        np.testing.assert_array_equal(longer[:-1], row)
        assert CallNumber().decode(longer[-1:]) is call
    assert CallNumber().decode(calling.encode(wanted)[-1:]) is Call.none


def test_a_joint_level_body_calls_and_its_torques_alone_are_silent(make_child):
    world, child = make_child(voice=VoiceKind.calls)
    ear = AudioSense(AudioCfg(waveform=True), child, world)
    row = np.zeros(83)

    def heard():
        world.step()
        return np.abs(ear.read()["waveform"]).max()

    child.act(row)
    assert heard() == 0.0
    child.apply_torque(np.zeros(82))
    assert heard() == 0.0
    row[-1] = -1.0
    child.act(row)
    assert heard() > 0.0


@pytest.mark.parametrize("wrong", [np.nan, 1.01, -7.0])
def test_an_impossible_call_is_refused_and_moves_nothing(make_child, wrong):
    _, child = make_child(voice=VoiceKind.calls)
    before = child._wishes.copy()
    with pytest.raises(ValueError, match=r"action: the number of the call is .*, not in \[-1, 1\]"):
        child.act(np.append(np.ones(82), wrong))
    np.testing.assert_array_equal(child._wishes, before)
