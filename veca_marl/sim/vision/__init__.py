"""Vision: cameras, rasterization, shading, optics of the eye and the sense of vision."""

from veca_marl.sim.vision.camera import Camera, MeshView, look_at, seen_fraction
from veca_marl.sim.vision.renderer import Views
from veca_marl.sim.vision.visibility import get_image, is_visible, open_eyes
from veca_marl.sim.vision.vision_sense import Eyes, EyeViews, VisionCfg, VisionSense

__all__ = [
    "Camera",
    "EyeViews",
    "Eyes",
    "MeshView",
    "Views",
    "VisionCfg",
    "VisionSense",
    "get_image",
    "is_visible",
    "look_at",
    "open_eyes",
    "seen_fraction",
]
