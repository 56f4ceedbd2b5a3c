"""Settings of the sense of vision."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.vision.camera import Camera
from veca_marl.sim.vision.image_filters import Blur, Defocus, Filter, Grey
from veca_marl.sim.vision.infant_vision import InfantVision

WIDEST_PUPIL_MM = 20.0
"""Greatest pupil, about the diameter of the eyeball."""

STRONGEST_ACCOMMODATION_DPT = 100.0
"""Greatest accommodation, focus at 1 cm."""


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
        if self.blur_deg < 0.0:
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
