"""A listener: the sound of all sources at one pair of ears."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound.mixers import make_mixer
from veca_marl.sim.sound.propagation.paths import Ears, Propagation
from veca_marl.sim.sound.propagation.receiver import Receiver
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.surroundings import Surroundings


@dataclass
class SoundClock:
    """The clock of a sound field.

    Attributes:
        sample_rate_hz: Sampling rate.
        step_samples: Samples per control step.
        steps: Control steps since the reset.
    """

    sample_rate_hz: int
    step_samples: int
    steps: int = 0


class Listener:
    """One pair of ears. Made by `SoundField.add_listener`."""

    def __init__(
        self,
        sources: Mapping[str, Source],
        surroundings: Surroundings,
        clock: SoundClock,
        receiver: Receiver,
        memory_steps: int = 1,
    ) -> None:
        self._sources = sources
        self._clock = clock
        self._memory_steps = memory_steps
        n = clock.step_samples
        self._mixer = make_mixer(receiver.n_channels, receiver.n_taps, n)
        self._ears = Ears(receiver, surroundings, self._mixer, clock.sample_rate_hz, n)
        self._propagations: dict[str, Propagation] = {}
        self._rendered_steps = clock.steps

    def reset(self) -> None:
        """Clear the signals and the last positions of all sources."""
        for propagation in self._propagations.values():
            propagation.reset()
        self._rendered_steps = self._clock.steps

    def teleport(self) -> None:
        """Let the next step be heard from elsewhere without a Doppler shift: sounds are faded over.

        As `Source.teleport` for a head that is moved at once.
        """
        self._ears.teleports += 1

    def forget(self, source: Source) -> None:
        """Drop the state that belongs to a source."""
        self._propagations.pop(source.name, None)

    @property
    def memory_samples(self) -> int:
        """How many samples of each source it needs."""
        return self._ears.reach_samples + self._memory_steps * self._clock.step_samples

    @property
    def missed_steps(self) -> int:
        """How many control steps before the present one were not rendered."""
        return max(self._clock.steps - self._rendered_steps - 1, 0)

    def rejoin(self, head: Pose, n_steps: int = 1) -> NDArray[np.float32]:
        """Render steps that were left out; `render` then continues with the present one.

        Head, sources and obstacles count as having been where they are now. This is exact where
        nothing moved; moving sources have no Doppler shift in those steps.

        Args:
            head: See `render`.
            n_steps: How many steps to return, at most the `memory_steps` of `add_listener`.

        Returns:
            ``(2, n_steps * step_samples)`` sound pressure of the steps before the present one.

        Raises:
            ValueError: If `n_steps` is not from 1 to `memory_steps`.
        """
        if not 1 <= n_steps <= self._memory_steps:
            raise ValueError(f"n_steps={n_steps} must be from 1 to {self._memory_steps}")
        n, heard = self._clock.step_samples, []
        for age in range(n_steps, 0, -1):
            audible = [p.add_past_step(head, age * n) for p in self._all_propagations()]
            heard.append(self._mixed(any(audible)))
        self._rendered_steps = self._clock.steps - 1
        return np.concatenate(heard, axis=1)

    def render(self, head: Pose) -> NDArray[np.float32]:
        """Render one control step. Call once after each `SoundField.advance`.

        The result is silence directly after a reset, before anything was emitted.

        Args:
            head: Midpoint between the ears and rotation of the head at the end of the step.

        Returns:
            ``(2, step_samples)`` sound pressure at the left and right ear, see `waveforms` for its
            unit; exactly 0 where nothing is audible.

        Raises:
            RuntimeError: If a step was left out or is rendered twice.
        """
        steps = self._clock.steps
        if steps == 0:
            return self._mixed(False)
        if steps != self._rendered_steps + 1:
            raise RuntimeError(
                f"a listener renders every control step once: it rendered step "
                f"{self._rendered_steps}, the field is at step {steps}; call rejoin() after steps "
                "left out"
            )
        self._rendered_steps = steps
        audible = [propagation.add_step(head) for propagation in self._all_propagations()]
        return self._mixed(any(audible))

    def _all_propagations(self) -> list[Propagation]:
        for name, source in self._sources.items():
            if name not in self._propagations:
                self._propagations[name] = Propagation(source, self._ears)
        return list(self._propagations.values())

    def _mixed(self, audible: bool) -> NDArray[np.float32]:
        if not audible:
            return np.zeros((2, self._clock.step_samples), np.float32)
        channels = self._mixer.finish()
        return np.repeat(channels, 2, axis=0) if len(channels) == 1 else channels
