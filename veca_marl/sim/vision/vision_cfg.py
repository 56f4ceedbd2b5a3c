"""Settings of the sense of vision."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.vision.image_filters import Blur, Defocus, Filter, Grey
from veca_marl.sim.vision.infant_vision import InfantVision
from veca_marl.sim.vision.optics import Camera


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
