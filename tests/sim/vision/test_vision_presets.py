"""Every preset of vision at two resolutions, and the strength of the one that ablates focus."""

import cv2
import numpy as np
import pytest
import torch
from composed import compose
from eye_scenes import FakeBody, clutter
from stand_in_worlds import SceneWorld

from veca_marl.algos.networks.encoders import Convolutions, ImageEncoder
from veca_marl.config import conf_dir
from veca_marl.sim.vision import VisionSense
from veca_marl.sim.vision.image_filters import Defocus

PRESETS = sorted(path.stem for path in (conf_dir() / "senses" / "vision").glob("*.yaml"))


def vision_cfg(preset, size=84):
    overrides = [
        f"senses/vision={preset}",
        *(f"senses.vision.{n}={size}" for n in ("width", "height")),
    ]
    return compose(["+task=MoveToTarget", *overrides]).senses.vision


def seen_at(preset, size):
    """The image of both eyes in front of a cluttered room."""
    scene = clutter(np.random.default_rng(3))
    body = FakeBody(np.array([-2.6, 0.0, 0.8]), np.array([0.0, 0.0, 0.4]), focal_distance_m=0.5)
    return VisionSense(vision_cfg(preset, size), body, SceneWorld(scene)).read()["vision"]


def reduced(images, size):
    """Images ``(2, 3, H, W)`` averaged over blocks to a smaller size."""
    return np.stack(
        [
            cv2.resize(np.moveaxis(i, 0, -1), (size, size), interpolation=cv2.INTER_AREA)
            for i in images
        ]
    )


@pytest.mark.parametrize("preset", [name for name in PRESETS if name != "blind"])
def test_every_preset_works_at_higher_resolutions(preset):
    """It shows the same at 84 and 168 pixels, since filters are defined in visual angles."""
    low, high = (seen_at(preset, size) for size in (84, 168))
    assert low.shape == (2, 3, 84, 84)
    assert high.shape == (2, 3, 168, 168)
    difference = np.abs(reduced(high, 84).astype(float) - reduced(low, 84))
    assert difference.mean() < 2.5
    features = ImageEncoder(high.shape, Convolutions((4, 4, 4)))(
        torch.from_numpy(high[None].copy())
    )
    assert features.isfinite().all()


def test_blind_eyes_have_no_observation_at_any_resolution():
    assert [vision_cfg("blind", size).present for size in (84, 168)] == [False, False]


def test_the_preset_that_ablates_focus_can_be_seen():
    """Blur discs of at least 2.9 pixels beyond 0.2 m, where those of the default pupil have 0.3."""
    cfg = vision_cfg("defocus")
    camera, lens = cfg.camera(), Defocus(cfg.pupil_mm / 1000.0, cfg.accommodation_dpt)
    for distance_m, pixels in ((0.2, 2.9), (0.3, 3.9), (1.0, 5.2), (5.0, 5.7)):
        disc_rad = lens.pupil_m * abs(1.0 / distance_m - lens.accommodation_dpt)
        assert np.degrees(disc_rad) / camera.degrees_per_pixel == pytest.approx(pixels, abs=0.05)
    sharp, blurred = (seen_at(preset, 84).astype(float) for preset in ("binocular", "defocus"))
    # a blurred edge has the same sum of differences and a smaller one of their squares
    edges = [np.square(np.diff(images, axis=-1)).mean() for images in (sharp, blurred)]
    assert edges[1] < 0.3 * edges[0]
