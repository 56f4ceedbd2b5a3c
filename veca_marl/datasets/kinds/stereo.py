"""Images of several toys for both eyes, with the depth and the disparity of what the left one sees.

The eyes are parallel: a point at the depth z is ``focal length * distance of the eyes / z`` pixels
farther to the left in the right eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.datasets.dataset import (
    TRIES,
    Dataset,
    DatasetCfg,
    NoSceneError,
    Sample,
    register_dataset,
)
from veca_marl.datasets.fields import Field, Role
from veca_marl.datasets.kinds.images import ALL_TOYS, image_field
from veca_marl.datasets.kinds.toy_scenes import (
    INTERPUPILLARY_M,
    EyePair,
    Floor,
    Gaze,
    ToyDraw,
    ToyScene,
    check_camera,
    empty_room,
    pixels_of,
)
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.vision import VisionCfg

_TARGET_M = 0.1
"""Height of the point at which the eyes look, about that of the middle of a toy."""


@dataclass
class DepthDisparityCfg(DatasetCfg):
    """Numbers of the maps of depth and disparity.

    Attributes:
        width_m: Least and greatest width of a toy.
        distance_m: Least and greatest distance of the eyes from the toy that they look at.
        height_m: Least and greatest height of the eyes.
        toys: Least and greatest number of toys.
        spread_m: Other toys are within this distance from the one that the eyes look at.
        least_pixels: Fewest pixels that show that toy, in each open eye.
        nearest_m: Least depth in the image.
        cells: Rows and columns of the maps; each is the depth at the middle of a cell.
    """

    name: str = "depth_disparity"
    width_m: tuple[float, float] = (0.1, 0.3)
    distance_m: tuple[float, float] = (0.35, 1.6)
    height_m: tuple[float, float] = (0.15, 1.0)
    toys: tuple[int, int] = (2, 6)
    spread_m: float = 0.8
    least_pixels: int = 100
    nearest_m: float = 0.15
    cells: int = 14

    def __post_init__(self) -> None:
        self.check_range("width_m", 0.02, 2.0)
        self.check_range("distance_m", 0.05, 20.0)
        self.check_range("height_m", 0.0, 10.0)
        self.check_range("toys", 1, 100)
        self.check_numbers(
            spread_m=(0.0, 10.0),
            least_pixels=(1, 1_000_000),
            nearest_m=(0.01, 10.0),
            cells=(1, 10_000),
        )


@register_dataset
class DepthDisparity(Dataset):
    """Maps of depth and disparity from the images of both eyes (ours)."""

    cfg_type = DepthDisparityCfg
    senses_used = ("vision",)

    def __init__(
        self, cfg: DepthDisparityCfg, senses: SensesCfg, playground: PlaygroundCfg
    ) -> None:
        vision: VisionCfg = senses.of("vision")
        self.cfg, self.eyes = cfg, EyePair(vision)
        check_camera(self.eyes.camera, cfg.least_pixels)
        if cfg.cells > min(vision.width, vision.height):
            raise ValueError(f"dataset.cells={cfg.cells} is more than the pixels of an image")
        self._room, self._floor = empty_room(playground), Floor.of(playground)
        self._gaze = Gaze(cfg.distance_m, cfg.height_m)
        self._toys = ToyDraw(ALL_TOYS, cfg.width_m)
        self._fov_deg = vision.fov_deg
        self._rows, self._columns = (
            ((np.arange(cfg.cells) + 0.5) * size / cfg.cells).astype(int)
            for size in (vision.height, vision.width)
        )
        self._factor = self.eyes.focal_px * INTERPUPILLARY_M
        self.fields = self._fields(vision)

    def _fields(self, vision: VisionCfg) -> dict[str, Field]:
        shape, near, far = (self.cfg.cells,) * 2, self.cfg.nearest_m, self.eyes.camera.far_m
        return {
            "vision": image_field(vision, eyes=True),
            "disparity": Field(
                shape, "float32", Role.label, self._factor / far * 0.999,
                self._factor / near * 1.001, "pixels",
                "of the left eye's image to the right one's, at the middle of each cell",
            ),
            "depth": Field(
                shape, "float32", Role.extra, near * 0.999, far * 1.001, "m",
                "along the axis of the left eye, at the middle of each cell",
            ),
        }  # fmt: skip

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        for _ in range(TRIES):
            position = self._floor.draw(rng)
            target = np.array([*position, _TARGET_M])
            middle = self._gaze.draw(rng, target, self._floor, self._fov_deg)
            if middle is None:
                continue
            scene = self._scene(rng, position)
            scene.finish()
            views = self.eyes.render(scene.scene, middle)
            depth = views.depth[0][np.ix_(self._rows, self._columns)]
            near = float(views.depth.min()) < self.cfg.nearest_m
            if not near and pixels_of(views, scene.toys[0]) >= self.cfg.least_pixels:
                return {
                    "vision": self.eyes.observe(views),
                    "disparity": (self._factor / depth).astype(np.float32),
                    "depth": np.ascontiguousarray(depth),
                }
        raise NoSceneError(self.name)

    def _scene(self, rng: np.random.Generator, position: Floats) -> ToyScene:
        """Return the room with a toy at a position ``(2,)``, and others around it."""
        scene = ToyScene(self._room)
        scene.add(rng, self._toys, position)
        low, high = self.cfg.toys
        for _ in range(int(rng.integers(low, high + 1)) - 1):
            aside = rng.uniform(-self.cfg.spread_m, self.cfg.spread_m, 2)
            scene.add(rng, self._toys, np.clip(position + aside, self._floor.low, self._floor.high))
        return scene
