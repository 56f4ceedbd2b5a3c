"""The sense of vision: the images of two eyes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Bools
from veca_marl.sim.physics import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.spec import ArraySpec
from veca_marl.sim.vision.image_filters import Blur, Defocus, Filter, FilterContext, Grey
from veca_marl.sim.vision.infant_vision import InfantVision
from veca_marl.sim.vision.optics import Camera, seen_fraction
from veca_marl.sim.vision.rendering import Views


class Eyes(Enum):
    """The number of open eyes; the shape of the observation does not depend on it."""

    binocular = "binocular"
    monocular = "monocular"


@dataclass
class VisionCfg:
    """Settings of the sense of vision.

    Attributes:
        present: Whether the observation contains the sense.
        width: Pixels of each eye's image.
        height: Pixels of each eye's image.
        fov_deg: Vertical field of view.
        eyes: `monocular` repeats the image of the left eye for the right one.
        grey: Replace colours by luma.
        blur_deg: Standard deviation of a Gaussian blur in degrees of visual angle; 0 for none.
        infant_age_months: Acuity and colour vision of an infant of that age; None for an adult's.
        defocus: Blur surfaces that are not at the focal distance of the eyes.
        depth: Also observe the depth of each pixel.
        segmentation: Also observe the object id of each pixel.
    """

    present: bool = True
    width: int = 84
    height: int = 84
    fov_deg: float = 60.0
    eyes: Eyes = Eyes.binocular
    grey: bool = False
    blur_deg: float = 0.0
    infant_age_months: float | None = None
    defocus: bool = False
    depth: bool = False
    segmentation: bool = False

    def __post_init__(self) -> None:
        self.camera()
        if not isinstance(self.eyes, Eyes):
            raise ValueError(f"eyes {self.eyes!r}; choices: {[eyes.name for eyes in Eyes]}")
        if self.blur_deg < 0.0:
            raise ValueError(f"blur_deg {self.blur_deg} must be 0 (none) or a positive angle")
        make_filters(self)

    def camera(self) -> Camera:
        """Return the camera of either eye."""
        return Camera(self.width, self.height, self.fov_deg)


def make_filters(cfg: VisionCfg) -> list[Filter]:
    """Return the filters of a configuration: optics of the lens first, then retina."""
    filters: list[Filter] = []
    if cfg.defocus:
        filters.append(Defocus())
    if cfg.blur_deg:
        filters.append(Blur(cfg.blur_deg))
    if cfg.infant_age_months is not None:
        filters.append(InfantVision(cfg.infant_age_months))
    if cfg.grey:
        filters.append(Grey())
    return filters


class VisionSense(Sense):
    """Two eyes of one body. It has no memory: steps that were not read change nothing.

    Rendering is lazy and happens once per state of the scene and the eyes: `read`, `is_visible` and
    `seen_fraction` share it in any order. `is_visible` and `seen_fraction` follow eyes that are
    turned within a step, `read` does not.

    Observations:
        vision: ``(2, 3, H, W)`` uint8, left eye first.
        depth: ``(2, H, W)`` float32 metres along the optical axis, on request.
        segmentation: ``(2, H, W)`` int16 object ids (-1 is the sky), on request. Like depth it
            shows what is behind transparent objects.

    Attributes:
        camera: The camera of either eye.
        filters: Filters in the order of their application.
    """

    cfg_type = VisionCfg

    def __init__(self, cfg: VisionCfg, body: Body, world: World) -> None:
        super().__init__(world)
        self.camera = cfg.camera()
        self.filters = make_filters(cfg)
        self.specs = _specs(cfg, self.camera)
        self._mounts = ("eye_left", "eye_right")[: 1 if cfg.eyes is Eyes.monocular else 2]
        self._body = body
        self._scene = world.scene
        self._hidden: Bools = np.zeros(0, np.bool_)
        self._seen: tuple[bytes, Views] | None = None

    def compute(self) -> dict[str, NDArray[Any]]:
        """See `Sense`."""
        views = self.views()
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

    def views(self) -> Views:
        """Return the present images of the open eyes before any filter; do not write into them."""
        poses = [self._body.mount(name) for name in self._mounts]
        state = self._scene.version.to_bytes(8) + b"".join(
            array.tobytes() for pose in poses for array in pose
        )
        if self._seen is None or self._seen[0] != state:
            self._seen = state, self.camera.render(self._scene, poses, self._own_head_mask())
        return self._seen[1]

    def seen_fraction(self, object_id: int) -> float:
        """Return the fraction of all pixels that show an object, also through transparent ones."""
        return seen_fraction(self.views(), object_id)

    def is_visible(self, object_id: int) -> bool:
        """Return whether a pixel of an open eye shows an object, also through transparent ones."""
        return self.seen_fraction(object_id) > 0.0

    def _own_head_mask(self) -> Bools:
        """Return the mask of the surfaces of the own head, recomputed when the scene has grown."""
        if len(self._hidden) != len(self._scene.surfaces.objects):
            self._hidden = self._scene.hidden(self._body.object_id, self._body.own_head_frames)
        return self._hidden


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
