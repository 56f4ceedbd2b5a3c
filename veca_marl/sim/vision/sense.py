"""The sense of vision: the images of two eyes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.physics import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.spec import ArraySpec
from veca_marl.sim.vision.camera import Camera
from veca_marl.sim.vision.image_filters import FilterContext
from veca_marl.sim.vision.vision_cfg import Eyes, VisionCfg, make_filters
from veca_marl.sim.vision.vision_sense import EyeViews


class VisionSense(Sense):
    """Two eyes of one body. It has no memory: steps that were not read change nothing.

    `eyes` renders once per state of the scene and the eyes; `read` and the tasks that ask for
    visibility share the images in any order. `eyes` follows eyes that are turned within a step,
    `read` does not.

    Observations:
        vision: ``(2, 3, H, W)`` uint8, left eye first.
        depth: ``(2, H, W)`` float32 metres along the optical axis, on request.
        segmentation: ``(2, H, W)`` int16 object ids (-1 is the sky), on request. Like depth it
            shows what is behind transparent objects.

    Attributes:
        eyes: The images of the open eyes before any filter.
        filters: Filters in the order of their application.
    """

    cfg_type = VisionCfg

    def __init__(self, cfg: VisionCfg, body: Body, world: World) -> None:
        super().__init__(world)
        camera = cfg.camera()
        mounts = EYES[:1] if cfg.eyes is Eyes.monocular else EYES
        self.eyes = EyeViews(world.scene, body, camera, mounts)
        self.filters = make_filters(cfg)
        self.specs = _specs(cfg, camera)
        self._body = body

    @property
    def camera(self) -> Camera:
        """The camera of either eye."""
        return self.eyes.camera

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        views = self.eyes.views()
        rgb = views.rgb
        context = FilterContext(self.camera, views.depth, self._body.focal_distance_m)
        for apply in self.filters:
            rgb = apply(rgb, context)
        everything: dict[str, NDArray[Any]] = {
            "vision": rgb.transpose(0, 3, 1, 2),
            "depth": views.depth,
            "segmentation": views.ids,
        }
        return {name: _for_both_eyes(everything[name]) for name in self.specs}


def _specs(cfg: VisionCfg, camera: Camera) -> dict[str, ArraySpec]:
    """Return the specs of a configuration."""
    size = (2, cfg.height, cfg.width)
    specs = {"vision": ArraySpec((2, 3, cfg.height, cfg.width), np.uint8, 0, 255)}
    if cfg.depth:
        specs["depth"] = ArraySpec(size, np.float32, 0.0, camera.far_m)
    if cfg.segmentation:
        specs["segmentation"] = ArraySpec(size, np.int16, -1, np.iinfo(np.int16).max)
    return specs


def _for_both_eyes(images: NDArray[Any]) -> NDArray[Any]:
    """Return contiguous images of both eyes; that of the open one stands for a closed one."""
    return np.ascontiguousarray(images if len(images) == 2 else images.repeat(2, axis=0))
