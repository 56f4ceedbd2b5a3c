"""Where on the skin a contact was, from the readings of the whole skin in any posture.

The body touches itself in many postures: what is felt is not only the contact in question.
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
from veca_marl.datasets.kinds.still_skin import (
    BonePoses,
    SkinObservation,
    StillSkin,
    binding_taxels,
)
from veca_marl.sim.body.anatomy import load_skeleton, load_skin
from veca_marl.sim.body.humanoid.postures import POSTURES, perturbed
from veca_marl.sim.geometry import Geom, Pose, Shape
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.touch import TouchCfg
from veca_marl.sim.touch.taxels import TAXELS_PER_TRIANGLE, load_taxels

_FAR = Pose(np.array([0.0, 0.0, 1000.0]), np.eye(3))
"""Where the ball touches nothing."""


@dataclass
class ContactLocalisationCfg(DatasetCfg):
    """Numbers of contact localisation.

    Attributes:
        radius_m: Least and greatest radius of the ball that touches the skin.
        depth: Least and greatest depth to which it is pressed, as a fraction of the thickness of
            the skin.
        spread_deg: Standard deviation of each joint from one of the postures of the body. Postures
            in which a bone presses the skin of another one down to the bone are drawn again.
    """

    name: str = "contact_localisation"
    radius_m: tuple[float, float] = (0.003, 0.02)
    depth: tuple[float, float] = (0.2, 0.9)
    spread_deg: float = 5.0

    def __post_init__(self) -> None:
        self.check_range("radius_m", 0.001, 0.2)
        self.check_range("depth", 0.01, 1.0)
        self.check_numbers(spread_deg=(0.0, 90.0))


@register_dataset
class ContactLocalisation(Dataset):
    """Where a ball touches the skin, from the readings of all taxels (ours)."""

    cfg_type = ContactLocalisationCfg
    senses_used = ("touch",)

    def __init__(
        self, cfg: ContactLocalisationCfg, senses: SensesCfg, playground: PlaygroundCfg
    ) -> None:
        self.cfg = cfg
        self._touch: TouchCfg = senses.of("touch")
        self._observe = SkinObservation(self._touch)
        self._binding = binding_taxels()
        corners = self._binding[:, :3]  # taxels near the corners: their area is a fixed fraction
        areas = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        self._chances = areas / areas.sum()
        self._owners = load_skin().owners
        bones = tuple(bone.name for bone in load_skeleton().bones)
        low, high = self._binding.min(axis=(0, 1)).min(), self._binding.max(axis=(0, 1)).max()
        self.fields = {
            **{
                name: Field(
                    (size,), "uint8", Role.input, 0, 255, "1/255 of a complete compression",
                    "readings of all taxels" if name == "touch" else "readings of the named parts",
                    () if name == "touch" else self._observe.part_names,
                )
                for name, size in self._observe.sizes.items()
            },
            "bone": Field(
                (), "int64", Role.label, 0, len(bones) - 1, "class",
                "bone to which the touched taxel belongs", bones,
            ),
            "position": Field(
                (3,), "float32", Role.label, float(low) - 1e-3, float(high) + 1e-3, "m",
                "of the touched taxel in the binding pose, arms and legs spread",
                ("forward", "left", "up"),
            ),
            "taxel": Field(
                (), "int64", Role.extra, 0, self._binding.shape[0] * TAXELS_PER_TRIANGLE - 1,
                "index", "the touched taxel, in the order of the sense of touch",
            ),
            "compression": Field(
                (), "float32", Role.extra, 0.0, 1.0, "fraction", "depth to which it is pressed",
            ),
        }  # fmt: skip

    def draw(self, rng: np.random.Generator) -> Sample:
        """See `Dataset`."""
        skeleton, postures = load_skeleton(), list(POSTURES.values())
        for _ in range(TRIES):
            posture = postures[int(rng.integers(len(postures)))]
            posture = perturbed(skeleton, posture, self.cfg.spread_deg, rng)
            radius_m, depth = rng.uniform(*self.cfg.radius_m), rng.uniform(*self.cfg.depth)
            ball = [Geom(Shape.SPHERE, (float(radius_m),))]
            skin = StillSkin(self._touch, BonePoses.of_posture(posture), ball)
            if skin.press(_FAR).max() >= 1.0:
                continue
            triangle = int(rng.choice(len(self._chances), p=self._chances))
            taxel = int(rng.integers(TAXELS_PER_TRIANGLE))
            table = load_taxels()
            positions, normals = skin.taxels()
            bone = int(self._owners[triangle])
            pressed_m = depth * table.thickness[bone]
            # the sensing point lies below the mesh, see `taxels`
            away_m = radius_m - pressed_m - table.depths[triangle, taxel]
            centre = positions[triangle, taxel] + away_m * normals[triangle]
            readings = skin.press(Pose(centre, np.eye(3)))
            if readings[triangle, taxel] > 0.0:
                return {
                    **self._observe(readings),
                    "bone": np.array(bone, np.int64),
                    "position": self._binding[triangle, taxel].astype(np.float32),
                    "taxel": np.array(triangle * TAXELS_PER_TRIANGLE + taxel, np.int64),
                    "compression": np.array(depth, np.float32),
                }
        raise NoSceneError(self.name)
