"""The page: a table of all laws, then each section with its text, table and plots."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.fidelity.law import Curve, Law, Mark, Plot, Section
from veca_marl.reports.figure import check_plotting
from veca_marl.version import __version__

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


PAGE = "fidelity.md"
_INTRODUCTION = """# Fidelity

Physics and senses against theory and published data. `python -m tools.fidelity`, run in a
checkout, measures each law anew and writes this page; it ends with exit status 1 if a law is
broken. The tests call the same functions. This page was written with veca_marl {version}.
"""
_COLUMNS = ("law", "theory", "measured", "tolerance", "verdict")


def write_page(folder: Path, sections: Mapping[str, Section]) -> Path:
    """Write the page and its pictures into a folder; return the path of the page.

    Args:
        folder: Created if absent. Pictures go into its folder ``fidelity``.
        sections: Measured sections by name.

    Raises:
        OSError: If a file cannot be written.
    """
    pictures = folder / Path(PAGE).stem
    pictures.mkdir(parents=True, exist_ok=True)
    for name, section in sections.items():
        for plot in section.plots:
            draw(pictures / picture_name(name, plot.title), plot)
    path = folder / PAGE
    path.write_text(page(sections), encoding="utf-8")
    return path


def page(sections: Mapping[str, Section]) -> str:
    """Return the page as Markdown."""
    parts = [_INTRODUCTION.format(version=__version__), _summary(sections)]
    parts += [_section(name, section) for name, section in sections.items()]
    return "\n".join(parts)


def picture_name(section: str, title: str) -> str:
    """Return the file name of a plot."""
    return f"{section}_{re.sub(r'[^a-z0-9]+', '_', title.lower()).strip('_')}.png"


def _summary(sections: Mapping[str, Section]) -> str:
    lines = ["| section | laws | broken |", "|---|---|---|"]
    for section in sections.values():
        broken = "; ".join(law.name for law in section.broken) or "none"
        lines.append(f"| {section.title} | {len(section.laws)} | {broken} |")
    return "\n".join(lines) + "\n"


def _section(name: str, section: Section) -> str:
    lines = [f"## {section.title}", "", section.text.strip(), ""]
    lines += [f"| {' | '.join(_COLUMNS)} |", "|---" * len(_COLUMNS) + "|"]
    lines += [f"| {' | '.join(_row(law))} |" for law in section.laws]
    for plot in section.plots:
        path = f"{Path(PAGE).stem}/{picture_name(name, plot.title)}"
        lines += ["", f"![{plot.title}]({path})"]
    return "\n".join(lines) + "\n"


def _row(law: Law) -> tuple[str, ...]:
    theory = "" if law.theory is None else number(law.theory, law.unit)
    verdict = "holds" if law.holds else "**broken**"
    return law.name, theory, number(law.measured, law.unit), _tolerance(law), verdict


def _tolerance(law: Law) -> str:
    if law.theory is not None:
        return f"± {number(law.high - law.theory, law.unit)}"
    if math.isinf(law.low):
        return f"at most {number(law.high, law.unit)}"
    if math.isinf(law.high):
        return f"at least {number(law.low, law.unit)}"
    return f"{number(law.low)} to {number(law.high, law.unit)}"


def number(value: float, unit: str = "") -> str:
    """Return a number with four digits and its unit."""
    return f"{value:.4g} {unit}".strip()
