"""Listeners that leave out control steps and go on."""

import numpy as np
import pytest
from listening import HEAD, RATE, SOURCES, STEP, make_receiver, noise, ratio_db, room, yaw
from refusals import naming

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound import Clip, SoundField


def field_with_noise(quality, seconds=0.3, step=STEP, memory_steps=1):
    """A reverberant room with two sources and a listener of one quality."""
    field = SoundField(room(), step, RATE, image_order=2)
    for index, position in enumerate(SOURCES):
        waveform = noise(int(seconds * RATE), seed=index)
        field.add_source(str(index), Clip(waveform)).position = position
    listener = field.add_listener(make_receiver(quality), memory_steps)
    field.reset(np.random.default_rng(0))
    return field, listener


def all_steps(quality, count, **scene):
    field, listener = field_with_noise(quality, **scene)
    heard = []
    for _ in range(count):
        field.advance()
        heard.append(listener.render(HEAD))
    return np.concatenate(heard, axis=1)


@pytest.mark.parametrize("quality", ["hrtf", "stereo", "mono"])
@pytest.mark.parametrize("missed", [1, 3, 8])
def test_a_still_scene_sounds_the_same_after_steps_left_out(quality, missed):
    """The sources stop in step 8: after as many steps left out only reflections arrive."""
    expected = all_steps(quality, missed + 4)
    field, listener = field_with_noise(quality)
    for _ in range(missed + 1):
        field.advance()
    assert listener.missed_steps == missed
    heard = [listener.rejoin(HEAD), listener.render(HEAD)]
    for _ in range(3):
        field.advance()
        heard.append(listener.render(HEAD))
    heard = np.concatenate(heard, axis=1)
    assert heard.any()
    np.testing.assert_allclose(heard, expected[:, -heard.shape[1] :], atol=2e-6)


@pytest.mark.parametrize("quality", ["hrtf", "stereo", "mono"])
def test_a_moving_scene_differs_only_until_its_reflections_have_arrived(quality):
    """A source at 1 m/s and a turning head; steps 3 to 5 are left out."""
    every, rare = [], []
    for heard, missed in ((every, ()), (rare, (3, 4, 5))):
        field, listener = field_with_noise(quality, seconds=1.0)
        for step in range(14):
            field.sources["0"].position = SOURCES[0] + (0.04 * step, 0.0, 0.0)
            head = Pose(HEAD.position, HEAD.rotation @ yaw(0.05 * step))
            field.advance()
            if step in missed:
                continue
            if listener.missed_steps:
                listener.rejoin(head)
            heard.append(listener.render(head))
    after_gap = ratio_db(every[6], rare[3])
    assert 3.0 < after_gap < 60.0
    np.testing.assert_allclose(rare[-4:], every[-4:], atol=2e-6)


def test_several_missed_steps_can_be_made_up_for():
    expected = all_steps("hrtf", 20, step=245)
    field, listener = field_with_noise("hrtf", step=245, memory_steps=4)
    for _ in range(20):
        field.advance()
    heard = np.concatenate([listener.rejoin(HEAD, 4), listener.render(HEAD)], axis=1)
    np.testing.assert_allclose(heard, expected[:, -5 * 245 :], atol=2e-6)


def test_sources_added_after_the_listener_are_remembered_as_long():
    field, listener = field_with_noise("mono", seconds=0.001)
    field.add_source("late", Clip(noise(4 * STEP))).position = SOURCES[0]
    for _ in range(3):
        field.advance()
    assert listener.rejoin(HEAD).std() > 0.01


def test_steps_that_are_not_remembered_are_refused():
    field, listener = field_with_noise("mono")
    for _ in range(3):
        field.advance()
    with pytest.raises(RuntimeError, match=naming("step 0", "step 3", "rejoin")):
        listener.render(HEAD)
    with pytest.raises(ValueError, match=naming("n_steps=2")):
        listener.rejoin(HEAD, 2)
