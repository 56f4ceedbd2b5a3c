"""The interface through which a world moves bodies."""

from __future__ import annotations

from typing import Protocol


class Mover(Protocol):
    """A body, or a group of bodies, that acts in a world: see `World.attach`."""

    def reset(self) -> None:
        """Return to the state at construction, after Bullet's state has been restored."""

    def before_step(self) -> None:
        """Prepare an agent step, before its first physics step."""

    def before_substep(self, substep_s: float) -> None:
        """Move or apply forces, before each physics step of `substep_s` seconds."""

    def write_frames(self) -> None:
        """Write the frames of the scene and the positions of sounds, once per agent step."""
