"""The sense of vision: its settings, what the eyes of a body see, and the observation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.body.sense_organs import EYES
from veca_marl.sim.geometry import Bools, Floats, Scene
from veca_marl.sim.physics import World
from veca_marl.sim.sense import ArraySpec, Sense
from veca_marl.sim.vision.camera import Camera, seen_fraction
from veca_marl.sim.vision.image_filters import (
    Blur,
    Defocus,
    Filter,
    FilterContext,
    Grey,
    InfantVision,
)
from veca_marl.sim.vision.renderer import Views

WIDEST_PUPIL_MM = 20.0
"""Greatest pupil, about the diameter of the eyeball."""

STRONGEST_ACCOMMODATION_DPT = 100.0
"""Greatest accommodation, focus at 1 cm."""


class EyeViews:
    """The images of the open eyes of one body, before any filter.

    Rendering is lazy and happens once per state of the scene and the eyes, so that the sense of
    vision and tasks that ask for visibility share it.

    Args:
        scene: The scene of the body.
        body: Its own head and neck hide nothing.
        camera: The camera of either eye.
        mounts: The open eyes, of `EYES`.

    Attributes:
        camera: The camera of either eye.

    Raises:
        ValueError: If there is no such eye, or none is open.
    """

    def __init__(
        self, scene: Scene, body: Body, camera: Camera, mounts: Sequence[str] = EYES
    ) -> None:
        if not mounts or not set(mounts) <= set(EYES):
            raise ValueError(f"no eyes {list(mounts)}; choices: {list(EYES)}")
        self.camera = camera
        self._scene, self._body = scene, body
        self._mounts = tuple(mounts)
        self._hidden: Bools = np.zeros(0, np.bool_)
        self._seen: tuple[bytes, Views] | None = None
        rows, columns = np.indices((camera.height, camera.width)) + 0.5
        self._off_centre_px: Floats = np.hypot(
            rows - camera.height / 2.0, columns - camera.width / 2.0
        ).ravel()

    def views(self) -> Views:
        """Return the present images, one per open eye; do not write into them."""
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

    def is_visible(self, object_id: int, eye: str | None = None) -> bool:
        """Return whether a pixel shows an object, also through transparent ones.

        Args:
            object_id: Its id in the scene.
            eye: One of the open eyes; None is any of them.

        Raises:
            ValueError: If this is not an open eye.
        """
        views = self.views() if eye is None else self._view_of(eye)
        return seen_fraction(views, object_id) > 0.0

    def front_objects(self) -> dict[int, float]:
        """Return the ids of all objects that are the foremost ones in at least one pixel.

        Objects that are seen only through transparent ones are left out.

        Returns:
            The smallest distance from the centre of an image for each, in pixels.
        """
        views = self.views()
        front = views.ids
        if len(views.glass_ids):
            nearest = views.glass_ids[0]
            front = np.where(nearest >= 0, nearest, front)
        distances = np.full(int(front.max()) + 2, np.inf)  # the last one is that of the sky, -1
        np.minimum.at(distances, front.ravel(), np.tile(self._off_centre_px, len(front)))
        return {number: float(d) for number, d in enumerate(distances[:-1]) if d < np.inf}

    def _view_of(self, eye: str) -> Views:
        """Return the images with that of one eye only."""
        if eye not in self._mounts:
            raise ValueError(f"no open eye {eye!r}; choices: {list(self._mounts)}")
        chosen = slice(index := self._mounts.index(eye), index + 1)
        planes, depth, ids, glass_ids = self.views()
        return Views(planes[chosen], depth[chosen], ids[chosen], glass_ids[:, chosen])

    def _own_head_mask(self) -> Bools:
        """Return the mask of the surfaces of the own head, recomputed when the scene has grown."""
        if len(self._hidden) != len(self._scene.surfaces.objects):
            self._hidden = self._scene.hidden(self._body.object_id, self._body.own_head_frames)
        return self._hidden


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
        infant_age_months: Acuity, contrast sensitivity and colour vision of an infant of that age;
            None for an adult's.
        defocus: Blur surfaces that are not at the focal distance of the eyes, see `Defocus`.
        pupil_mm: Diameter of the pupil with `defocus`, above 0 and at most 20 mm; those of humans
            have 2 to 8 mm. A surface that is out of focus by D dioptres is blurred over a disc of
            ``pupil_mm * D`` milliradians; a pixel of the default image covers 13.7.
        accommodation_dpt: Accommodation with `defocus`, 0 (focused at infinity) to 100 dioptres
            (1 cm), for eyes that cannot change it; None leaves it to the body
            (`Body.adjust_focal_length`).
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
    pupil_mm: float = 4.0
    accommodation_dpt: float | None = None
    depth: bool = False
    segmentation: bool = False

    def __post_init__(self) -> None:
        self.camera()
        if not isinstance(self.eyes, Eyes):
            raise ValueError(f"eyes {self.eyes!r}; choices: {[eyes.name for eyes in Eyes]}")
        if not 0.0 <= self.blur_deg < math.inf:
            raise ValueError(f"blur_deg {self.blur_deg} must be 0 (none) or a positive angle")
        self._check_lens()
        make_filters(self)

    def _check_lens(self) -> None:
        """Check the numbers of `Defocus`, also while it is not used."""
        if not 0.0 < self.pupil_mm <= WIDEST_PUPIL_MM:
            raise ValueError(
                f"pupil_mm {self.pupil_mm} must be above 0 and at most {WIDEST_PUPIL_MM:g}"
            )
        dioptres = self.accommodation_dpt
        if dioptres is not None and not 0.0 <= dioptres <= STRONGEST_ACCOMMODATION_DPT:
            raise ValueError(
                f"accommodation_dpt {dioptres} must be from 0 (infinity) to "
                f"{STRONGEST_ACCOMMODATION_DPT:g}, or null (as the body adjusts it)"
            )

    def camera(self) -> Camera:
        """Return the camera of either eye."""
        return Camera(self.width, self.height, self.fov_deg)


def make_filters(cfg: VisionCfg) -> list[Filter]:
    """Return the filters of a configuration: optics of the lens first, then retina."""
    filters: list[Filter] = []
    if cfg.defocus:
        filters.append(Defocus(cfg.pupil_mm / 1000.0, cfg.accommodation_dpt))
    if cfg.blur_deg:
        filters.append(Blur(cfg.blur_deg))
    if cfg.infant_age_months is not None:
        filters.append(InfantVision(cfg.infant_age_months))
    if cfg.grey:
        filters.append(Grey())
    return filters


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
        everything: dict[str, NDArray[Any]] = {
            "vision": self._filtered(views) if self.filters else views.planes,
            "depth": views.depth,
            "segmentation": views.ids,
        }
        return {name: _for_both_eyes(everything[name]) for name in self.specs}

    def _filtered(self, views: Views) -> NDArray[np.uint8]:
        """Return the planes of the images after all filters."""
        context = FilterContext(self.camera, views.depth, self._body.focal_distance_m)
        rgb = np.ascontiguousarray(views.rgb)
        for apply in self.filters:
            rgb = apply(rgb, context)
        return rgb.transpose(0, 3, 1, 2)


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
