"""The blue debug lines of touch in an image, as in the paper's `getTactile` with `debug`."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.vision import Camera

BLUE = (40, 90, 255)


def draw_tactile_lines(
    image: NDArray[np.uint8], camera: Camera, pose: Pose, lines: Floats
) -> NDArray[np.uint8]:
    """Return an image with lines in blue; they are not hidden by what is in front of them.

    Args:
        image: ``(H, W, 3)`` uint8 RGB, as rendered by the camera.
        camera: The camera.
        pose: Its pose.
        lines: ``(n, 2, 3)`` metres, as from `get_tactile` with `debug`.

    Raises:
        ValueError: If the image has not the size of the camera's.
    """
    if image.shape != (camera.height, camera.width, 3):
        raise ValueError(f"image {image.shape}, not {(camera.height, camera.width, 3)}")
    drawn = np.ascontiguousarray(image).copy()
    ends = camera.project(pose, lines.reshape(-1, 3)).reshape(-1, 2, 3)
    for start, end in ends[(ends[..., 2] > camera.near_m).all(axis=1)]:
        first, last = np.floor(start[:2]).astype(int), np.floor(end[:2]).astype(int)
        cv2.line(drawn, first.tolist(), last.tolist(), BLUE)
    return drawn
