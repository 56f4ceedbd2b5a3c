"""The figure of a report: learning curves of the arms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from veca_marl.reports.scores import Run, curve

_SIZE_INCHES = (5.5, 3.8)  # of one panel
_DPI = 120
_LABELS = {
    "frames": "frames of experience",
    "minutes": "minutes of training",
    "core_minutes": "core-minutes of training",
}


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
    arms: Mapping[str, Sequence[Run]],
    baselines: Mapping[str, float],
    title: str,
    label: str,
) -> None:
    """Write the figure: scores over frames and over minutes of processor time.

    Thick lines are interquartile means with their intervals, thin ones single runs. Where processor
    times were not measured, elapsed minutes are shown; without those, the panel is left out.

    Args:
        path: The PNG file.
        arms: Runs of each arm.
        baselines: Score of each policy that does not learn; NaN is not drawn.
        title: Title of the figure.
        label: Label of the vertical axis.
    """
    check_plotting()
    from matplotlib.figure import Figure

    axes_names = ["frames", *_time_axis(arms)]
    width, height = _SIZE_INCHES
    figure = Figure(figsize=(width * len(axes_names), height), layout="constrained")
    panels = figure.subplots(1, len(axes_names), squeeze=False, sharey=True)[0]
    for axis, name in zip(panels, axes_names, strict=True):
        _draw_panel(axis, name, arms, baselines)
    panels[0].set_ylabel(label)
    panels[0].legend(frameon=False)
    figure.suptitle(title)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DPI, metadata={"Software": None})


def _time_axis(arms: Mapping[str, Sequence[Run]]) -> list[str]:
    """Return the name of the time that was measured at all points, if there is one."""
    points = [point for runs in arms.values() for run in runs for point in run.points]
    for name in ("core_minutes", "minutes"):
        if not any(math.isnan(getattr(point, name)) for point in points):
            return [name]
    return []


def _draw_panel(
    axis: Any, name: str, arms: Mapping[str, Sequence[Run]], baselines: Mapping[str, float]
) -> None:
    for arm, runs in arms.items():
        colour = _draw_curve(axis, name, arm, runs)
        for run in runs:
            x = [getattr(point, name) for point in run.points]
            axis.plot(x, [point.score for point in run.points], color=colour, lw=0.6, alpha=0.5)
    for style, (policy, score) in zip((":", "--"), baselines.items(), strict=False):
        if not math.isnan(score):
            axis.axhline(score, color="grey", ls=style, label=policy)
    axis.margins(y=0.08)
    axis.set_xlabel(_LABELS[name])
    axis.set_xlim(0, None)


def _draw_curve(axis: Any, name: str, arm: str, runs: Sequence[Run]) -> Any:
    """Draw the interquartile mean of an arm and its interval; return the colour of the line."""
    points = curve(runs)
    x = [getattr(point, name) for point in points]
    (line,) = axis.plot(x, [point.score for point in points], label=arm, lw=2.0)
    low, high = zip(*(point.interval for point in points), strict=True)
    colour = line.get_color()
    axis.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
    return colour
