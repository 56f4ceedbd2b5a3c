"""Results of measurements: laws with their verdict, plots, and sections of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum


@dataclass(frozen=True)
class Law:
    """A quantity that was measured, and the interval that it has to be in.

    Use `equals`, `at_most`, `at_least` or `between`. For a law over many cases, pass the largest
    error to `at_most`.

    Attributes:
        name: What is measured and under which conditions, one line.
        unit: Its unit; empty for a ratio.
        measured: Its measured value. NaN breaks the law.
        low: The least value that obeys the law; may be ``-inf``.
        high: The greatest value that obeys the law; may be ``inf``.
        theory: The value that theory gives; None if theory gives an interval.
    """

    name: str
    unit: str
    measured: float
    low: float
    high: float
    theory: float | None = None

    def __post_init__(self) -> None:
        """Check the interval."""
        if not self.name:
            raise ValueError("a law without a name")
        if not self.low <= self.high:
            raise ValueError(f"law {self.name!r}: no value is in [{self.low}, {self.high}]")

    @property
    def holds(self) -> bool:
        """Whether the measured value is in the interval."""
        return self.low <= self.measured <= self.high


def equals(name: str, unit: str, theory: float, measured: float, tolerance: float) -> Law:
    """Return the law that `measured` differs from `theory` by `tolerance` at most."""
    if not tolerance >= 0.0:
        raise ValueError(f"law {name!r}: tolerance={tolerance} must be 0 or more")
    return Law(name, unit, measured, theory - tolerance, theory + tolerance, theory)


def at_most(name: str, unit: str, limit: float, measured: float) -> Law:
    """Return the law that `measured` is not above `limit`."""
    return Law(name, unit, measured, -math.inf, limit)


def at_least(name: str, unit: str, limit: float, measured: float) -> Law:
    """Return the law that `measured` is not below `limit`."""
    return Law(name, unit, measured, limit, math.inf)


def between(name: str, unit: str, low: float, high: float, measured: float) -> Law:
    """Return the law that `measured` is in ``[low, high]``."""
    return Law(name, unit, measured, low, high)


class Mark(Enum):
    """How a curve is drawn."""

    line = "line"
    dashes = "dashes"
    points = "points"
    bars = "bars"


@dataclass(frozen=True)
class Curve:
    """Values over a quantity, or over categories.

    Attributes:
        label: Its name in the legend; empty leaves it out.
        x: Numbers, or names of categories.
        y: As many numbers; NaN is not drawn.
        mark: How it is drawn.
    """

    label: str
    x: Sequence[float] | Sequence[str]
    y: Sequence[float]
    mark: Mark = Mark.line

    def __post_init__(self) -> None:
        """Check the lengths."""
        if len(self.x) != len(self.y):
            raise ValueError(f"curve {self.label!r}: {len(self.x)} x and {len(self.y)} y")


@dataclass(frozen=True)
class Plot:
    """A picture of curves over one pair of axes.

    Attributes:
        title: Its title, unique in its section.
        x_label: Quantity and unit of the horizontal axis.
        y_label: Quantity and unit of the vertical axis.
        curves: What is drawn.
        log_x: Whether the horizontal axis is logarithmic.
        log_y: Whether the vertical axis is logarithmic.
    """

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Section:
    """One subject of the page.

    Attributes:
        title: Heading.
        text: Markdown that states what is measured, how, and the sources of theory.
        laws: What must hold.
        plots: Pictures.
    """

    title: str
    text: str
    laws: Sequence[Law]
    plots: Sequence[Plot] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        """Check that there is a law, and that names are unique."""
        for kind, names in (
            ("laws", [law.name for law in self.laws]),
            ("plots", [plot.title for plot in self.plots]),
        ):
            if len(set(names)) < len(names):
                raise ValueError(f"section {self.title!r}: {kind} share a name: {names}")
        if not self.laws:
            raise ValueError(f"section {self.title!r} has no law")

    @property
    def broken(self) -> list[Law]:
        """The laws that do not hold."""
        return [law for law in self.laws if not law.holds]
