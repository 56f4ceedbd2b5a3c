"""What a world stores besides Bullet's saved state, so that it can be restored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Scene
from veca_marl.sim.sound.sounds import Sound, Source


@dataclass(frozen=True)
class BuiltSound:
    """What one source emitted when its world was frozen.

    Attributes:
        source: The source.
        sound: Its sound; a source may emit another one later.
        muted: Whether it was muted.
    """

    source: Source
    sound: Sound
    muted: bool


@dataclass(frozen=True)
class BuiltState:
    """Colours and sounds of a frozen world, which episodes may change.

    Attributes:
        colours: ``(S, 3)`` of all surfaces of the scene.
        sounds: One entry for each source.
    """

    colours: NDArray[np.float32]
    sounds: tuple[BuiltSound, ...]

    def restore(self, scene: Scene) -> None:
        """Set the colours of the scene and the sounds of the sources to those stored here."""
        scene.surfaces.colours[:] = self.colours
        for built in self.sounds:
            built.source.sound, built.source.muted = built.sound, built.muted


def built_state(scene: Scene, sources: Mapping[str, Source]) -> BuiltState:
    """Return the present colours of a scene and the present sounds of the sources."""
    sounds = tuple(BuiltSound(source, source.sound, source.muted) for source in sources.values())
    return BuiltState(scene.surfaces.colours.copy(), sounds)


class BulletSetting(Protocol):
    """A setting of Bullet that changes in an episode and that Bullet's saved states lack."""

    def forget(self) -> None:
        """Undo it, before a saved state is restored."""

    def apply(self) -> None:
        """Set it as its owner says, after the state has been restored."""


@dataclass(frozen=True)
class SavedPhysics:
    """What `World.save_physics` returns.

    Attributes:
        state: See `saved_state`.
        gravity: m/s^2 along x, y and z.
    """

    state: bytes
    gravity: tuple[float, float, float]
