"""What a sense needs of a world, for tests of one sense without physics."""

from dataclasses import dataclass

from veca_marl.sim.geometry import Scene
from veca_marl.sim.sound import SoundField


@dataclass
class SceneWorld:
    """A scene alone; every `Scene.update` counts as a new state."""

    scene: Scene

    @property
    def version(self):
        return self.scene.version


@dataclass
class SoundWorld:
    """A sound field alone; every `SoundField.advance` counts as a new state."""

    sound: SoundField

    @property
    def version(self):
        return self.sound.clock
