"""Scenes and measures of the tests of hearing."""

import numpy as np
import scipy.signal

from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import HrtfReceiver, MonoReceiver, StereoReceiver, kemar_table
from veca_marl.sim.sound import Clip, Room, SoundField

RATE = 22_050
STEP = 882
EAR = 0.0875
ROOM_SIZE = (8.0, 6.0, 3.0)


def yaw(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


STILL = Pose(np.zeros(3), np.eye(3))
HEAD = Pose(np.array([5.3, 2.2, 1.6]), yaw(0.7))
OTHER_HEAD = Pose(np.array([1.0, 1.0, 1.2]), yaw(-2.0))
SOURCES = np.array([[2.1, 3.7, 1.2], [5.0, 1.0, 0.4]])


def make_receiver(quality):
    return {
        "hrtf": lambda: HrtfReceiver(kemar_table()),
        "stereo": lambda: StereoReceiver((0.0, EAR, 0.0), (0.0, -EAR, 0.0)),
        "mono": MonoReceiver,
    }[quality]()


def room(beta=0.7):
    return Room(np.zeros(3), ROOM_SIZE, beta)


def noise(n_samples, seed=0):
    """Noise in the lower half of the band, where the observation lies."""
    low_pass = scipy.signal.firwin(101, 0.49)
    white = np.random.default_rng(seed).standard_normal(n_samples + 200)
    return scipy.signal.lfilter(low_pass, 1, white)[200:].astype(np.float32)


def render(waveforms, place, quality="hrtf", *, room=None, order=0, n_steps, step=STEP):
    """Render moving sources; `place(i)` gives source positions and head at the end of step i."""
    field = SoundField(room, step, RATE, order)
    sources = [field.add_source(str(i), Clip(w)) for i, w in enumerate(waveforms)]
    listener = field.add_listener(make_receiver(quality))
    field.reset(np.random.default_rng(0))
    heard = []
    for i in range(n_steps):
        positions, head = place(i)
        for source, position in zip(sources, positions, strict=True):
            source.position = position
        field.advance()
        heard.append(listener.render(head))
    return np.concatenate(heard, axis=1)


def render_still(waveforms, positions, head=HEAD, quality="hrtf", **scene):
    step = scene.get("step", STEP)
    scene.setdefault("n_steps", len(waveforms[0]) // step)
    return render(waveforms, lambda i: (positions, head), quality, **scene)


def ratio_db(reference, found):
    """Signal over difference."""
    difference = ((reference - found) ** 2).sum()
    return 10.0 * np.log10((reference**2).sum() / max(difference, 1e-30))


def direction(azimuth_deg, elevation_deg=0.0):
    azimuth, elevation = np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg)
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def interaural_time(heard, low_hz, high_hz):
    """Seconds by which the left ear leads, from the cross-correlation in a band."""
    n = 1 << 15
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    band = (frequency > low_hz) & (frequency < high_hz)
    left, right = np.fft.rfft(heard, n)
    correlation = np.fft.irfft(left * np.conj(right) * band, n * 16)
    lag = int(correlation.argmax())
    return -(lag - n * 16 if lag > n * 8 else lag) / 16 / RATE
