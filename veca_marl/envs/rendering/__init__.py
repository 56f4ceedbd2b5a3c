"""Images and video frames of a game for people."""

from veca_marl.envs.rendering.spectator import Spectator, eye_images
from veca_marl.envs.rendering.touch_image import save_touch_image, touch_image

__all__ = ["Spectator", "eye_images", "save_touch_image", "touch_image"]
