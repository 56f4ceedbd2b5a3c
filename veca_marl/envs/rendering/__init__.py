"""Pictures and films of a game for people."""

from veca_marl.envs.rendering.cameras import CameraKind
from veca_marl.envs.rendering.film import Film, FilmCfg, FilmQuality
from veca_marl.envs.rendering.photograph import Quality, photograph
from veca_marl.envs.rendering.skin_views import (
    draw_tactile_lines,
    save_touch_image,
    touch_image,
    touch_readings,
)
from veca_marl.envs.rendering.spectator import Spectator

__all__ = [
    "CameraKind",
    "Film",
    "FilmCfg",
    "FilmQuality",
    "Quality",
    "Spectator",
    "draw_tactile_lines",
    "photograph",
    "save_touch_image",
    "touch_image",
    "touch_readings",
]
