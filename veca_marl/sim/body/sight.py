"""What a body knows of its own eyes: the interface that the package `vision` implements.

Bodies are below vision in the order of imports. `veca_marl.sim.senses.make_senses` gives each body
its sight, see `Body.sight`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop

_BOX_MARGIN_M = 0.3  # more than the margins of Bullet's boxes and the motion of a prop in a step


class Visible(Protocol):
    """What eyes can look for: a prop or a body.

    Attributes:
        object_id: Its id in the scene.
    """

    object_id: int


class Sight(Protocol):
    """The present images of the open eyes of a body. `EyeViews` is one."""

    def is_visible(self, object_id: int, eye: str | None = None) -> bool:
        """Return whether a pixel shows an object, also through transparent ones.

        Args:
            object_id: Its id in the scene.
            eye: One of the open eyes; None is any of them.

        Raises:
            ValueError: If this is not an open eye.
        """
        ...

    def front_objects(self) -> Mapping[int, float]:
        """Return the ids of all objects that are the foremost ones in at least one pixel.

        Objects that are seen only through transparent ones are left out.

        Returns:
            The smallest distance from the centre of an image for each, in pixels.
        """
        ...


def interactable_props(
    sight: Sight, eyes: Floats, props: Iterable[Prop], range_m: float
) -> list[Prop]:
    """Return the props that can be interacted with, the nearest to the centre of the view first.

    These declare an interaction, are visible and not only through transparent objects, and nearer
    than the range. The order of equally near ones is that of `props`.

    Args:
        sight: The images of the eyes.
        eyes: ``(3,)`` metres: the place from which distances are measured.
        props: Those to choose from.
        range_m: The distance to the bounding box of a prop must be smaller.
    """
    near = [
        prop
        for prop in props
        if prop.cfg.interactions
        and _may_be_nearer(prop, eyes, range_m)
        and distance_m(prop, eyes) < range_m
    ]
    if not near:
        return []
    front = sight.front_objects()
    seen = [prop for prop in near if prop.object_id in front]
    return sorted(seen, key=lambda prop: front[prop.object_id])


def _may_be_nearer(prop: Prop, point: Floats, range_m: float) -> bool:
    """Return False for a prop of which the bounding box is certainly farther from a point.

    This takes a tenth of the time of `distance_m`, and most props of a house are far away. The
    corners of a box along the world's axes are at most sqrt(3) times as far from the origin of the
    prop's frame as its own points.
    """
    reach_m = math.sqrt(3.0) * prop.extent_m + _BOX_MARGIN_M
    return math.dist(prop.position, point) < range_m + reach_m


def distance_m(prop: Prop, point: Floats) -> float:
    """Return the distance from a point to the bounding box of a prop along the world's axes."""
    low, high = prop.bounds()
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low - point, point - high))))
