"""Images and video frames of a game for people."""

from veca_marl.envs.rendering.room_view import RoomView
from veca_marl.envs.rendering.spectator import Spectator, eye_images
from veca_marl.envs.rendering.tactile_lines import draw_tactile_lines
from veca_marl.envs.rendering.touch_image import save_touch_image, touch_image

__all__ = [
    "RoomView",
    "Spectator",
    "draw_tactile_lines",
    "eye_images",
    "save_touch_image",
    "touch_image",
]
