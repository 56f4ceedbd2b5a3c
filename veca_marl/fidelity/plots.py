"""Plots of the page as PNG files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from veca_marl.fidelity.law import Curve, Mark, Plot
from veca_marl.reports.figure import check_plotting

_SIZE_INCHES = (6.5, 4.0)
_DPI = 100
_STYLES: dict[Mark, dict[str, Any]] = {
    Mark.line: {"ls": "-"},
    Mark.dashes: {"ls": "--"},
    Mark.points: {"ls": "", "marker": "o", "ms": 4},
}


def draw(path: Path, plot: Plot) -> None:
    """Write a plot as a PNG file.

    Raises:
        PlotError: If matplotlib is missing.
    """
    check_plotting()
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_INCHES, layout="constrained")
    axis = figure.subplots()
    for curve in plot.curves:
        _draw_curve(axis, curve)
    axis.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    if plot.log_x:
        axis.set_xscale("log")
    if plot.log_y:
        axis.set_yscale("log")
    if any(curve.label for curve in plot.curves):
        axis.legend(frameon=False, fontsize="small")
    if any(isinstance(x, str) for curve in plot.curves for x in curve.x):
        axis.tick_params(axis="x", labelrotation=90)
    figure.savefig(path, dpi=_DPI, metadata={"Software": None})


def _draw_curve(axis: Any, curve: Curve) -> None:
    label = curve.label or None
    if curve.mark is Mark.bars:
        axis.bar(curve.x, curve.y, label=label, alpha=0.7)
    else:
        axis.plot(curve.x, curve.y, label=label, **_STYLES[curve.mark])
