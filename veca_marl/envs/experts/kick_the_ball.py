"""Expert of KickTheBall: steer by the difference between the ears."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.tasks.kick_the_ball import KickTheBall
from veca_marl.sim.hearing import AudioSense

# difference of the ears' mean log10 spectra at which the expert turns at full speed
_FULL_TURN_LEVEL = 0.05


@register_expert("KickTheBall")
class KickTheBallExpert(Expert[KickTheBall]):
    """Turns toward the louder ear and walks forward.

    Reads the observation ``audio`` only; it uses no privileged state.
    """

    reads = needs = ("audio",)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> tuple[float, float]:
        """Return (forward, turn), see `Expert.act`."""
        ears = self.player.senses["audio"]
        assert isinstance(ears, AudioSense)
        left, right = ears.log_magnitudes(observation["audio"]).mean(axis=-1)
        turn = float(np.clip((left - right) / _FULL_TURN_LEVEL, -1.0, 1.0))
        return 1.0 - abs(turn) / 2.0, turn
