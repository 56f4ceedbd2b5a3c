"""Two eyes: what a body sees from its eye mounts."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.geometry.tables import Bools
from veca_marl.sim.physics.world import World
from veca_marl.sim.sense import Sense
from veca_marl.sim.spec import ArraySpec
from veca_marl.sim.vision.image_filters import Blur, Defocus, Filter, Grey, Look
from veca_marl.sim.vision.infant_vision import InfantVision
from veca_marl.sim.vision.optics import Camera, seen_fraction
from veca_marl.sim.vision.rendering import Views


class Eyes(Enum):
    """How many eyes are open. The observation's shape does not depend on it."""

    binocular = "binocular"
    monocular = "monocular"


@dataclass
class VisionCfg:
    """The eyes and what dims them.

    Attributes:
        present: Whether the body can see at all.
        width: Pixels of each eye's image.
        height: Pixels of each eye's image.
        fov_deg: Vertical field of view.
        eyes: Monocular repeats the left eye's image for the right one.
        grey: Take the colours away.
        blur_deg: Standard deviation of a Gaussian blur in degrees of visual angle; 0 for none.
        infant_age_months: Acuity and colour vision of that age; None for an adult's.
        defocus: Blur what is not at the distance to which the eyes' lenses are adjusted.
        depth: Also observe the distance of each pixel.
        segmentation: Also observe whose each pixel is.
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
            raise ValueError(f"eyes {self.eyes!r}: want one of {[eyes.name for eyes in Eyes]}")
        if self.blur_deg < 0.0:
            raise ValueError(f"blur_deg {self.blur_deg}: want 0 (none) or a positive angle")
        make_filters(self)

    def camera(self) -> Camera:
        """Return the camera of either eye."""
        return Camera(self.width, self.height, self.fov_deg)


def make_filters(cfg: VisionCfg) -> list[Filter]:
    """Return the filters a configuration asks for, in the order light meets them."""
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
    """What one body sees.

    Rendering is lazy and done once per state of the world: `read`, `is_visible` and
    `seen_fraction` share it in any order.

    Attributes:
        camera: The lens and the pixels of either eye.
        filters: Applied to the images in this order.
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
        """Return `vision` ``(2, 3, H, W)`` uint8 and what else was asked for.

        `depth` ``(2, H, W)`` float32 metres along the optical axis and `segmentation`
        ``(2, H, W)`` int16 object ids (-1 is the sky) show what is behind transparent objects.
        """
        views = self.views()
        rgb = views.rgb
        look = Look(self.camera, views.depth, self._body.focal_distance_m)
        for apply in self.filters:
            rgb = apply(rgb, look)
        everything: dict[str, NDArray[Any]] = {
            "vision": rgb.transpose(0, 3, 1, 2),
            "depth": views.depth,
            "segmentation": views.ids,
        }
        return {name: _two(everything[name]) for name in self.specs}

    def views(self) -> Views:
        """Return what the open eyes see now, before any filter; not to be written into."""
        poses = [self._body.mount(name) for name in self._mounts]
        state = self._scene.version.to_bytes(8) + b"".join(
            array.tobytes() for pose in poses for array in pose
        )
        if self._seen is None or self._seen[0] != state:
            self._seen = state, self.camera.render(self._scene, poses, self._own_head())
        return self._seen[1]

    def seen_fraction(self, object_id: int) -> float:
        """Return the share of the eyes' pixels that show an object, also through glass."""
        return seen_fraction(self.views(), object_id)

    def is_visible(self, object_id: int) -> bool:
        """Return whether a pixel of an open eye shows an object, also through glass."""
        return self.seen_fraction(object_id) > 0.0

    def _own_head(self) -> Bools:
        """Mask of the surfaces that would fill the eyes; renewed when the scene has grown."""
        if len(self._hidden) != len(self._scene.surfaces.objects):
            self._hidden = self._scene.hidden(self._body.object_id, self._body.own_head_frames)
        return self._hidden


def _specs(cfg: VisionCfg, camera: Camera) -> dict[str, ArraySpec]:
    """Names and shapes of what `VisionSense.read` will return."""
    size = (2, cfg.height, cfg.width)
    specs = {"vision": ArraySpec((2, 3, cfg.height, cfg.width), np.uint8, 0, 255)}
    if cfg.depth:
        specs["depth"] = ArraySpec(size, np.float32, 0.0, camera.far_m)
    if cfg.segmentation:
        specs["segmentation"] = ArraySpec(size, np.int16, -1, np.iinfo(np.int16).max)
    return specs


def _two(images: NDArray[Any]) -> NDArray[Any]:
    """One image per eye, contiguous: a closed eye's place is filled by the open one's."""
    return np.ascontiguousarray(images if len(images) == 2 else images.repeat(2, axis=0))
