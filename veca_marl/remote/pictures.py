"""How a client asks for pictures of its worlds."""

from __future__ import annotations

from typing import Any

from veca_marl.envs.rendering.cameras import CameraKind
from veca_marl.envs.rendering.film import FilmCfg, FilmQuality
from veca_marl.remote.messages import ProtocolError, flag, integer, text

LARGEST = (1920, 1080)
"""Width and height; a server spends a second on such a picture."""


def fields_of(cfg: FilmCfg) -> dict[str, Any]:
    """Return the fields of a request.

    Raises:
        ValueError: If the picture is larger than a server makes them.
    """
    if cfg.width > LARGEST[0] or cfg.height > LARGEST[1]:
        raise ValueError(
            f"a server makes pictures of at most {LARGEST[0]} x {LARGEST[1]} pixels, not "
            f"{cfg.width} x {cfg.height}"
        )
    return {
        "camera": cfg.camera.name,
        "agent": cfg.agent,
        "width": cfg.width,
        "height": cfg.height,
        "panels": cfg.panels,
        "quality": cfg.quality.name,
    }


def choices_of(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a `FilmCfg` that a request asks for.

    Raises:
        ProtocolError: If one is missing or impossible.
    """
    camera, quality = text(fields, "camera"), text(fields, "quality")
    if camera not in CameraKind.__members__ or quality not in FilmQuality.__members__:
        raise ProtocolError(f"there is no camera {camera!r} with the quality {quality!r}")
    return {
        "camera": CameraKind[camera],
        "agent": text(fields, "agent"),
        "width": integer(fields, "width", 64, LARGEST[0]),
        "height": integer(fields, "height", 64, LARGEST[1]),
        "panels": flag(fields, "panels"),
        "quality": FilmQuality[quality],
    }
