"""The direction of a sound, heard for 0.2 s."""

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
from veca_marl.datasets.kinds.recordings import (
    Recorder,
    SourceKind,
    direction_in_head,
    draw_sound,
    head_rotation,
    waveform_field,
)
from veca_marl.datasets.kinds.toy_scenes import Floor
from veca_marl.sim.geometry import Pose
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg


@dataclass
class SoundLocalisationCfg(DatasetCfg):
    """Numbers of sound localisation.

    Attributes:
        distance_m: Least and greatest distance of the source from the middle of the head.
        head_m: Least and greatest height of the head.
        source_m: Least and greatest height of the source.
        tilt_deg: Greatest pitch and roll of the head.
        level_db: Least and greatest level of the sound, relative to an rms pressure of 1 at 1 m.
    """

    name: str = "sound_localisation"
    distance_m: tuple[float, float] = (0.4, 4.0)
    head_m: tuple[float, float] = (0.3, 1.2)
    source_m: tuple[float, float] = (0.05, 2.2)
    tilt_deg: float = 20.0
    level_db: tuple[float, float] = (-30.0, -10.0)

    def __post_init__(self) -> None:
        self.check_range("distance_m", 0.2, 20.0)
        self.check_range("head_m", 0.1, 10.0)
        self.check_range("source_m", 0.01, 10.0)
        self.check_range("level_db", -120.0, 20.0)
        self.check_numbers(tilt_deg=(0.0, 90.0))


@register_dataset
class SoundLocalisation(Dataset):
    """The direction from which a sound comes, relative to the head (the paper's set)."""

    cfg_type = SoundLocalisationCfg
    senses_used = ("audio",)

    def __init__(
        self, cfg: SoundLocalisationCfg, senses: SensesCfg, playground: PlaygroundCfg
    ) -> None:
        self.cfg, self._floor = cfg, Floor.of(playground)
        self._recorder = Recorder(senses.of("audio"), playground)
        highest = max(cfg.head_m[1], cfg.source_m[1])
        if highest >= self._floor.ceiling_m:
            raise ValueError(
                f"dataset.source_m, dataset.head_m: {highest} is above the ceiling at "
                f"{self._floor.ceiling_m} m"
            )
        low, high = cfg.distance_m
        self.fields = {
            "waveform": waveform_field(),
            "direction": Field(
                (3,), "float32", Role.label, -1.0001, 1.0001, "unit vector",
                "from the middle of the head to the source, in the frame of the head",
                ("forward", "left", "up"),
            ),
            "distance": Field(
                (), "float32", Role.extra, low * 0.999, high * 1.001, "m",
                "from the middle of the head to the source",
            ),
            "sound": Field(
                (), "int64", Role.extra, 0, len(SourceKind) - 1, "class", "kind of the sound",
                tuple(kind.name for kind in SourceKind),
            ),
        }  # fmt: skip

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        low, high = self.cfg.distance_m
        for _ in range(TRIES):
            head = np.array([*self._floor.draw(rng), rng.uniform(*self.cfg.head_m)])
            source = np.array([*self._floor.draw(rng), rng.uniform(*self.cfg.source_m)])
            away = float(np.linalg.norm(source - head))
            if low <= away <= high:
                break
        else:
            raise NoSceneError(self.name)
        rotation = head_rotation(rng, self.cfg.tilt_deg)
        drawn = draw_sound(rng, self.cfg.level_db)
        heard = self._recorder.record(rng, drawn.sound, source, Pose(head, rotation))
        return {
            "waveform": heard,
            "direction": direction_in_head(rotation, source - head).astype(np.float32),
            "distance": np.array(away, np.float32),
            "sound": np.array(drawn.kind, np.int64),
        }
