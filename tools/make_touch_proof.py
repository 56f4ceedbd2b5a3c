"""Plot the peaks of touch readings and of solver forces over the physics step.

A ball of 0.2 kg falls 2 cm onto the palm, which has compliant skin, and onto the forearm, where
only the rigid bone collides. Touch readings depend on geometry alone, solver forces on the time
step. Writes ``docs/images/touch_time_step.png`` and prints the table of
``docs/reference/touch.md``.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

from tools.fidelity.touch.fixed_arms import FOREARM, PALM, Ball, clocks, peaks

mpl.use("Agg")
import matplotlib.pyplot as plt

PICTURE = Path(__file__).resolve().parent.parent / "docs/images/touch_time_step.png"


def draw(path: Path) -> None:
    """Measure, print the table and plot."""
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.2), layout="constrained")
    step_ms = [1000.0 * clock.substep_s for clock in clocks(0.02)]
    print("| physics step | " + " | ".join(f"{step:.0f} ms" for step in step_ms) + " |")
    for name, spot, share, style in (
        ("palm, margin 0.1", PALM, 0.1, "o-"),
        ("palm, default", PALM, 0.02, "o:"),
        ("forearm (rigid)", FOREARM, 0.02, "s-"),
    ):
        touch, force = peaks(spot, Ball(), clocks(share))
        print(f"| {name}: peak T | " + " | ".join(f"{value:.2f}" for value in touch) + " |")
        print(f"| {name}: peak force | " + " | ".join(f"{value:.0f} N" for value in force) + " |")
        axes[0].plot(step_ms, touch, style, label=name)
        axes[1].plot(step_ms, force, style, label=name)
    axes[0].set(ylabel="peak touch T", ylim=(0.0, 1.05))
    axes[1].set(ylabel="peak force of the solver (N)", yscale="log")
    for axis in axes:
        axis.set(xlabel="physics step (ms)", xscale="log")
        axis.set_xticks(step_ms, [f"{step:.0f}" for step in step_ms])
        axis.minorticks_off()
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(PICTURE)
