"""One head and one source in a sound field, as the sense of hearing observes it."""

import numpy as np
from listening import EAR, RATE, STEP
from stand_in_worlds import SoundWorld

from veca_marl.sim.body.anatomy import REFERENCE
from veca_marl.sim.geometry import Pose
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.sound import Clip, SoundField, buzz, tone


def buzz_at(pitch):
    return Clip(buzz(pitch, 0.1, RATE), loop=True)


def tone_at(pitch):
    return Clip(tone(pitch, 0.1, RATE), loop=True)


class Dummy:
    """A head with two ears slightly behind its centre."""

    teleports = 0
    deaf_to = frozenset()
    growth = REFERENCE

    def __init__(self):
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        self.mouth = (0.08, 0.0, -0.02)

    def mount(self, name):
        offset = {
            "head": (0.0, 0.0, 0.0),
            "ear_left": (-0.01, EAR, 0.02),
            "ear_right": (-0.01, -EAR, 0.02),
            "mouth": self.mouth,
        }[name]
        return Pose(self.position + self.rotation @ np.array(offset), self.rotation)


class Scene:
    """One body and one source in a sound field."""

    def __init__(self, sound, box=None, **numbers):
        self.field = SoundField(box, STEP, RATE, image_order=2)
        self.body = Dummy()
        self.source = self.field.add_source("source", sound)
        self.sense = AudioSense(AudioCfg(**numbers), self.body, SoundWorld(self.field))
        self.reset()

    def reset(self, seed=0):
        self.field.reset(np.random.default_rng(seed))
        self.sense.reset()

    def hear(self, n_steps=3):
        for _ in range(n_steps):
            self.field.advance()
            observation = self.sense.read()
        return {name: value.copy() for name, value in observation.items()}
