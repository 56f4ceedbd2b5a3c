"""The figure of a report: learning curves of the arms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from veca_marl.reports.summary import CurvePoint

_SIZE_INCHES = (5.5, 3.8)  # of one panel
_DPI = 120


class PlotError(ValueError):
    """A figure cannot be drawn."""


def check_plotting() -> None:
    """Check that matplotlib is installed.

    Raises:
        PlotError: If it is not.
    """
    if find_spec("matplotlib") is None:
        raise PlotError("the figure needs matplotlib: pip install 'veca_marl[plot]'")


def draw(
    path: Path,
    curves: Mapping[str, Sequence[CurvePoint]],
    baselines: Mapping[str, float],
    title: str,
    label: str,
) -> None:
    """Write the figure: interquartile means with their intervals, over frames and over minutes.

    The panel over minutes is left out where minutes were not measured.

    Args:
        path: The PNG file.
        curves: Points of each arm.
        baselines: Score of each policy that does not learn; NaN is not drawn.
        title: Title of the figure.
        label: Label of the vertical axis.
    """
    check_plotting()
    from matplotlib.figure import Figure

    axes_names = ["frames"]
    if all(not math.isnan(point.minutes) for points in curves.values() for point in points):
        axes_names.append("minutes")
    width, height = _SIZE_INCHES
    figure = Figure(figsize=(width * len(axes_names), height), layout="constrained")
    panels = figure.subplots(1, len(axes_names), squeeze=False, sharey=True)[0]
    for axis, name in zip(panels, axes_names, strict=True):
        _draw_panel(axis, name, curves, baselines)
    panels[0].set_ylabel(label)
    panels[0].legend(frameon=False)
    figure.suptitle(title)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI, metadata={"Software": None})


def _draw_panel(
    axis: Any,
    name: str,
    curves: Mapping[str, Sequence[CurvePoint]],
    baselines: Mapping[str, float],
) -> None:
    for arm, points in curves.items():
        x = [getattr(point, name) for point in points]
        (line,) = axis.plot(x, [point.score for point in points], label=arm)
        low, high = zip(*(point.interval for point in points), strict=True)
        axis.fill_between(x, low, high, color=line.get_color(), alpha=0.2, lw=0)
    for style, (policy, score) in zip((":", "--"), baselines.items(), strict=False):
        if not math.isnan(score):
            axis.axhline(score, color="grey", ls=style, label=policy)
    axis.set_xlabel("frames of experience" if name == "frames" else "minutes of training")
    axis.set_xlim(0, None)
