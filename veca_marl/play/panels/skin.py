"""The touched skin: front and back of the body with the readings of touch in colour."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering import touch_image
from veca_marl.play.panels.drawing import Image, absent, titled
from veca_marl.sim.geometry import Floats, Scene, SceneObject
from veca_marl.sim.touch import TAXELS_PER_TRIANGLE, load_taxels
from veca_marl.sim.touch.parts import skin_parts


def skin_panel(
    scene: Scene, body: SceneObject, observation: Mapping[str, NDArray[Any]], height: int
) -> Image:
    """Return front and back of a body, ``(height, 4/3 height, 3)`` uint8.

    Each taxel is coloured by its reading (observation `touch`), or each part of the skin by the
    greatest reading in it (`touch_parts`).

    Args:
        scene: The scene.
        body: The body.
        observation: Its observation; without touch the panel states that.
        height: Height of the panel in pixels.
    """
    readings = _readings(observation)
    if readings is None:
        return absent(height, 2 * (height * 2 // 3), "skin: no touch")
    panel = np.ascontiguousarray(touch_image(scene, body, readings, height))
    largest = readings.max(initial=0.0)
    return titled(panel, f"skin, front and back; greatest reading {largest:.2f}")


def _readings(observation: Mapping[str, NDArray[Any]]) -> Floats | None:
    """Return the readings of all taxels, ``(1648, 6)``; None without touch."""
    if "touch" in observation:
        return observation["touch"].reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
    if "touch_parts" not in observation:
        return None
    readings = np.zeros(load_taxels().depths.shape)
    parts = skin_parts()
    maxima = observation["touch_parts"][len(parts) :]
    for part, reading in zip(parts, maxima, strict=True):
        readings[part.triangles] = reading
    return readings
