"""What every sense has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.spec import ArraySpec


class Sense(ABC):
    """One modality of one body: numpy in, numpy out.

    A sense keeps no state that another body's sense could see.

    Attributes:
        specs: Observation name to its spec, known before the first read. Most senses have one
            entry under their own name; extras on request (`depth`, `waveform`) are further entries.
    """

    specs: dict[str, ArraySpec]

    def reset(self) -> None:  # noqa: B027  a sense without memory has nothing to forget
        """Forget the last episode. Called after the world and the bodies were put in place."""

    def substep(self) -> None:  # noqa: B027  most senses only look once per control step
        """Gather what happens between two reads. Called after every physics substep; cheap."""

    @abstractmethod
    def read(self) -> dict[str, NDArray[Any]]:
        """Sense the world as it is at the end of a control step. Called once per step.

        Returns:
            An array for each name in `specs`. The caller copies what it keeps.
        """


def check_spec(name: str, value: NDArray[Any], spec: ArraySpec) -> None:
    """Raise `ValueError` if `value` is not what `spec` promises."""
    if value.shape != spec.shape or value.dtype != np.dtype(spec.dtype):
        raise ValueError(
            f"{name}: got {value.dtype}{value.shape}, the spec says {spec.dtype}{spec.shape}"
        )
