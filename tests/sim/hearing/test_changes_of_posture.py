"""A head that is moved at once: sounds are faded over, without a Doppler shift."""

import numpy as np
import pytest
from scipy.signal import hilbert
from walking import box, empty_world, walker_in

from veca_marl.sim.hearing import AudioCfg, AudioQuality, AudioSense
from veca_marl.sim.sound import SoundCfg, SoundKind


@pytest.mark.parametrize("verb", ["step_on", "crawl", "place", "none"])
def test_a_change_of_posture_is_not_heard_as_a_doppler_shift(verb):
    """A tone of 1 kHz; the head of the listener is moved at once."""
    tone = SoundCfg(kind=SoundKind.tone, frequency_hz=1000.0, level=0.1)
    source = box("source", (0.05, 0.05, 0.05), 0.0, (4.0, 0.0, 0.8), sound=tone)
    world = empty_world(source, box("block", (0.6, 0.6, 0.15), 0.0, (0.7, 0.0, 0.075)))
    walker = walker_in(world, verbs=["crawl", "stand_up", "step_on"])
    cfg = AudioCfg(quality=AudioQuality.mono, waveform=True)
    sense = AudioSense(cfg, walker, world)
    acts = {
        "step_on": lambda: walker.step_on(world.prop("block")),
        "crawl": walker.crawl,
        "place": lambda: walker.place((0.7, 0.0, 0.0)) or True,
        "none": lambda: True,
    }
    heard = []
    for step in range(8):
        assert step != 5 or acts[verb]()
        world.step()
        heard.append(sense.read()["waveform"][0].astype(float))
    phase = np.unwrap(np.angle(hilbert(np.concatenate(heard))))
    n = len(heard[0])
    frequencies_hz = np.diff(phase)[5 * n : 6 * n] * 22_050 / (2.0 * np.pi)
    # the fade itself shifts the phase by up to half a period within the step
    assert np.median(frequencies_hz) == pytest.approx(1000.0, rel=0.006)
