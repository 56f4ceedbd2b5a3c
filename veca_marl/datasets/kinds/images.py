"""Images of one toy: which it is, how far away it is, and where it is in the image."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.datasets.dataset import (
    TRIES,
    Dataset,
    DatasetCfg,
    NoSceneError,
    Sample,
    register_dataset,
)
from veca_marl.datasets.fields import Field, Role
from veca_marl.datasets.kinds.toy_scenes import (
    EyePair,
    Floor,
    Gaze,
    ToyDraw,
    ToyScene,
    check_camera,
    empty_room,
    pixels_of,
)
from veca_marl.sim.geometry import Pose
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.physics.props.toys import ToyKind
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.vision import Views, VisionCfg

ALL_TOYS = tuple(ToyKind)
TOY_NAMES = tuple("ball" if kind is ToyKind.sphere else kind.value for kind in ALL_TOYS)
"""Names of `ALL_TOYS` in labels; the paper's word for a sphere is ball."""


@dataclass
class ImageCfg(DatasetCfg):
    """Numbers of the images of one toy.

    Attributes:
        width_m: Least and greatest width of a toy.
        distance_m: Least and greatest distance of the camera from its centre.
        height_m: Least and greatest height of the camera.
        least_pixels: Fewest pixels that show the toy, in each open eye.
    """

    width_m: tuple[float, float] = (0.15, 0.3)
    distance_m: tuple[float, float] = (0.4, 1.6)
    height_m: tuple[float, float] = (0.15, 1.2)
    least_pixels: int = 100

    def __post_init__(self) -> None:
        self.check_range("width_m", 0.02, 2.0)
        self.check_range("distance_m", 0.05, 20.0)
        self.check_range("height_m", 0.0, 10.0)
        self.check_numbers(least_pixels=(1, 1_000_000))


def image_field(cfg: VisionCfg, eyes: bool) -> Field:
    """Return the field of the images.

    Args:
        cfg: Settings of vision.
        eyes: Whether both eyes are stored, or only the left one.
    """
    size = (3, cfg.height, cfg.width)
    meaning = "images of the left and the right eye" if eyes else "image of the left eye"
    return Field(
        (2, *size) if eyes else size, "uint8", Role.input, 0, 255, "1/255",
        f"{meaning}: red, green, blue",
    )  # fmt: skip


def class_field(names: tuple[str, ...], meaning: str, role: Role = Role.label) -> Field:
    """Return the field of one class among named ones."""
    return Field((), "int64", role, 0, len(names) - 1, "class", meaning, names)


class ToyImages(Dataset):
    """Images of one toy on the floor of a room, seen from anywhere.

    Subclasses say what is read from a view.

    Attributes:
        toys: How the toy is drawn.
    """

    senses_used = ("vision",)
    kinds: ClassVar[tuple[ToyKind, ...]] = ALL_TOYS
    both_eyes: ClassVar[bool] = False

    def __init__(self, cfg: ImageCfg, senses: SensesCfg, playground: PlaygroundCfg) -> None:
        vision: VisionCfg = senses.of("vision")
        self.cfg, self.eyes = cfg, EyePair(vision)
        check_camera(self.eyes.camera, cfg.least_pixels)
        self._room, self._floor = empty_room(playground), Floor.of(playground)
        self._fov_deg = vision.fov_deg
        self._gaze = Gaze(cfg.distance_m, cfg.height_m)
        self.toys = ToyDraw(self.kinds, cfg.width_m)
        self.fields = {self.image_key: image_field(vision, self.both_eyes), **self.labels(vision)}

    @property
    def image_key(self) -> str:
        """Name of the field of the images: that of the sense if both eyes are stored."""
        return "vision" if self.both_eyes else "image"

    @abstractmethod
    def labels(self, vision: VisionCfg) -> dict[str, Field]:
        """Return the fields beside the images."""

    @abstractmethod
    def read(self, scene: ToyScene, views: Views, middle: Pose) -> Sample:
        """Return the arrays of `labels`.

        Args:
            scene: The room with one toy.
            views: The images of the open eyes.
            middle: Pose between the eyes.
        """

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        for _ in range(TRIES):
            scene = ToyScene(self._room)
            scene.add(rng, self.toys, self._floor.draw(rng))
            middle = self._gaze.draw(rng, scene.centres[0], self._floor, self._fov_deg)
            if middle is None:
                continue
            scene.finish()
            views = self.eyes.render(scene.scene, middle)
            if pixels_of(views, scene.toys[0]) >= self.cfg.least_pixels:
                return {self.image_key: self._image(views), **self.read(scene, views, middle)}
        raise NoSceneError(self.name)

    def _image(self, views: Views) -> NDArray[Any]:
        observed = self.eyes.observe(views)
        return observed if self.both_eyes else np.ascontiguousarray(observed[0])


@dataclass
class ObjectClassificationCfg(ImageCfg):
    """Numbers of object classification by sight."""

    name: str = "object_classification"


@register_dataset
class ObjectClassification(ToyImages):
    """Which of three toys is in an image: doll, ball or pyramid (the paper's set)."""

    cfg_type = ObjectClassificationCfg
    kinds = (ToyKind.doll, ToyKind.sphere, ToyKind.pyramid)

    def labels(self, vision: VisionCfg) -> dict[str, Field]:
        """See `ToyImages`."""
        return {"kind": class_field(("doll", "ball", "pyramid"), "kind of the toy")}

    def read(self, scene: ToyScene, views: Views, middle: Pose) -> Sample:
        """See `ToyImages`."""
        return {"kind": np.array(scene.kinds[0], np.int64)}


@dataclass
class DistanceEstimationCfg(ImageCfg):
    """Numbers of distance estimation."""

    name: str = "distance_estimation"
    distance_m: tuple[float, float] = (0.3, 4.0)
    least_pixels: int = 12


@register_dataset
class DistanceEstimation(ToyImages):
    """How far a toy is from the eyes (the paper's set, with both eyes)."""

    cfg_type = DistanceEstimationCfg
    both_eyes = True

    def labels(self, vision: VisionCfg) -> dict[str, Field]:
        """See `ToyImages`."""
        low, high = self.cfg.distance_m
        return {
            "distance": Field(
                (1,), "float32", Role.label, low - 1e-3, high + 1e-3, "m",
                "from the middle of the eyes to the centre of the toy",
            ),
            "kind": class_field(TOY_NAMES, "kind of the toy", Role.extra),
        }  # fmt: skip

    def read(self, scene: ToyScene, views: Views, middle: Pose) -> Sample:
        """See `ToyImages`."""
        away = np.linalg.norm(scene.centres[0] - middle.position)
        return {
            "distance": np.array([away], np.float32),
            "kind": np.array(scene.kinds[0], np.int64),
        }


@dataclass
class ObjectRecognitionCfg(ImageCfg):
    """Numbers of object recognition."""

    name: str = "object_recognition"


@register_dataset
class ObjectRecognition(ToyImages):
    """Where a toy is in an image: its box as centre, height and width (the paper's set)."""

    cfg_type = ObjectRecognitionCfg

    def labels(self, vision: VisionCfg) -> dict[str, Field]:
        """See `ToyImages`."""
        return {
            "box": Field(
                (4,), "float32", Role.label, 0.0, 1.0, "fraction of the image",
                "centre from the left, centre from the top, height and width of the pixels that "
                "show the toy", ("x", "y", "h", "w"),
            ),
            "kind": class_field(TOY_NAMES, "kind of the toy", Role.extra),
        }  # fmt: skip

    def read(self, scene: ToyScene, views: Views, middle: Pose) -> Sample:
        """See `ToyImages`."""
        box = box_of(views.ids[0] == scene.toys[0].id)
        return {"box": box, "kind": np.array(scene.kinds[0], np.int64)}


def box_of(shown: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the smallest box around some pixels, ``(x, y, h, w)`` in fractions of the image.

    Args:
        shown: ``(H, W)``, true in at least one pixel.
    """
    height, width = shown.shape
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    top, bottom = rows[0] / height, (rows[-1] + 1) / height
    left, right = columns[0] / width, (columns[-1] + 1) / width
    return np.array(
        [(left + right) / 2, (top + bottom) / 2, bottom - top, right - left], np.float32
    )
