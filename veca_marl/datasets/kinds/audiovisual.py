"""Which of several visible toys sounds: sight and hearing have to be joined."""

from __future__ import annotations

import math
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
from veca_marl.datasets.kinds.images import ALL_TOYS, class_field, image_field
from veca_marl.datasets.kinds.recordings import (
    EAR_CENTRE_M,
    Recorder,
    draw_sound,
    head_rotation,
    waveform_field,
)
from veca_marl.datasets.kinds.toy_scenes import (
    EyePair,
    Floor,
    ToyDraw,
    ToyScene,
    check_camera,
    empty_room,
    pixels_of,
)
from veca_marl.sim.body.sense_organs import EYES, MOUNTS_M
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.vision import VisionCfg

COLOURS = {"red": (0.9, 0.12, 0.12), "green": (0.15, 0.8, 0.2), "blue": (0.15, 0.3, 0.95)}
"""Colours of the toys; the label is the one that sounds."""

_EYE_CENTRE_M: Floats = (np.array(MOUNTS_M[EYES[0]]) + np.array(MOUNTS_M[EYES[1]])) / 2.0


@dataclass
class AudiovisualCorrespondenceCfg(DatasetCfg):
    """Numbers of audiovisual correspondence.

    Attributes:
        width_m: Least and greatest width of a toy.
        distance_m: Least and greatest distance of each toy from the eyes, along the floor.
        head_m: Least and greatest height of the head.
        apart_deg: Least horizontal angle between two toys, seen from the head.
        least_pixels: Fewest pixels that show each toy, in each open eye.
        tilt_deg: Greatest pitch and roll of the head.
        level_db: Least and greatest level of the sound, relative to an rms pressure of 1 at 1 m.
    """

    name: str = "audiovisual_correspondence"
    width_m: tuple[float, float] = (0.15, 0.3)
    distance_m: tuple[float, float] = (0.6, 2.0)
    head_m: tuple[float, float] = (0.4, 0.8)
    apart_deg: float = 12.0
    least_pixels: int = 30
    tilt_deg: float = 5.0
    level_db: tuple[float, float] = (-30.0, -10.0)

    def __post_init__(self) -> None:
        self.check_range("width_m", 0.02, 2.0)
        self.check_range("distance_m", 0.1, 20.0)
        self.check_range("head_m", 0.1, 10.0)
        self.check_range("level_db", -120.0, 20.0)
        self.check_numbers(apart_deg=(0.0, 60.0), least_pixels=(1, 1_000_000), tilt_deg=(0.0, 45.0))


@register_dataset
class AudiovisualCorrespondence(Dataset):
    """Which of three visible toys sounds: the red, the green or the blue one (ours)."""

    cfg_type = AudiovisualCorrespondenceCfg
    senses_used = ("vision", "audio")

    def __init__(
        self, cfg: AudiovisualCorrespondenceCfg, senses: SensesCfg, playground: PlaygroundCfg
    ) -> None:
        vision: VisionCfg = senses.of("vision")
        self.cfg, self._eyes = cfg, EyePair(vision)
        check_camera(self._eyes.camera, cfg.least_pixels)
        self._recorder = Recorder(senses.of("audio"), playground)
        self._room, self._floor = empty_room(playground), Floor.of(playground)
        self._toys = ToyDraw(ALL_TOYS, cfg.width_m)
        # half of the horizontal field of view, where the middle of a toy can be
        tan_x = float(self._eyes.camera.lens.tan_x)
        self._half_rad = 0.9 * math.atan(tan_x)
        self.fields = {
            "vision": image_field(vision, eyes=True),
            "waveform": waveform_field(),
            "sounding": class_field(tuple(COLOURS), "colour of the toy that sounds"),
            "azimuths": Field(
                (len(COLOURS),), "float32", Role.extra, -90.0, 90.0, "degrees",
                "of the red, the green and the blue toy, to the left of straight ahead",
                tuple(COLOURS),
            ),
        }  # fmt: skip

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        for _ in range(TRIES):
            head, rotation = self._draw_head(rng)
            azimuths = rng.uniform(-self._half_rad, self._half_rad, len(COLOURS))
            far_m = rng.uniform(*self.cfg.distance_m, len(COLOURS))
            gaps = np.diff(np.sort(azimuths))
            positions = self._positions(head, rotation, azimuths, far_m)
            if gaps.min() < math.radians(self.cfg.apart_deg) or positions is None:
                continue
            scene = ToyScene(self._room)
            for position, colour in zip(positions, COLOURS.values(), strict=True):
                scene.add(rng, self._toys, position, colour)
            scene.finish()
            views = self._eyes.render(scene.scene, Pose(head + rotation @ _EYE_CENTRE_M, rotation))
            if min(pixels_of(views, toy) for toy in scene.toys) < self.cfg.least_pixels:
                continue
            chosen = int(rng.integers(len(COLOURS)))
            sound = draw_sound(rng, self.cfg.level_db).sound
            ears = Pose(head + rotation @ EAR_CENTRE_M, rotation)
            return {
                "vision": self._eyes.observe(views),
                "waveform": self._recorder.record(rng, sound, scene.centres[chosen], ears),
                "sounding": np.array(chosen, np.int64),
                "azimuths": np.degrees(azimuths).astype(np.float32),
            }
        raise NoSceneError(self.name)

    def _draw_head(self, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Return position and rotation of a head; it looks down a little, at the floor ahead."""
        head = np.array([*self._floor.draw(rng), rng.uniform(*self.cfg.head_m)])
        rotation = head_rotation(rng, self.cfg.tilt_deg)
        down = math.atan2(head[2], sum(self.cfg.distance_m) / 2.0)
        cosine, sine = math.cos(down), math.sin(down)
        pitch = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        return head, rotation @ pitch

    def _positions(
        self, head: Floats, rotation: Floats, azimuths: Floats, far_m: Floats
    ) -> Floats | None:
        """Return positions ``(toys, 2)`` on the floor; None if one is outside of the room."""
        ahead = math.atan2(rotation[1, 0], rotation[0, 0])
        angles = ahead + azimuths
        positions: Floats = head[:2] + far_m[:, None] * np.stack(
            [np.cos(angles), np.sin(angles)], axis=1
        )
        return positions if all(self._floor.contains(position) for position in positions) else None
