"""Gather the evaluations of runs, draw their curves and print how they end.

python experiments/curves.py experiments/soccer RUN ...   # gather into results.csv, then draw
python experiments/curves.py experiments/soccer           # draw from results.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib as mpl
import yaml

mpl.use("Agg")
import matplotlib.pyplot as plt

Panel = tuple[str, str]


def gather(experiment: Path, runs: list[Path]) -> None:
    """Write the evaluations of all run folders into one table; tasks may have different terms."""
    rows = []
    for run in runs:
        config = yaml.safe_load((run / "config.yaml").read_text())
        with (run / "evaluations.csv").open() as table:
            for row in csv.DictReader(table):
                rows.append({"task": config["task"]["name"], "seed": config["seed"], **row})
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with (experiment / "results.csv").open("w", newline="") as table:
        writer = csv.DictWriter(table, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read(experiment: Path) -> dict[Panel, list[dict[str, str]]]:
    """Return the rows of every team of every task."""
    panels: dict[Panel, list[dict[str, str]]] = {}
    with (experiment / "results.csv").open() as table:
        for row in csv.DictReader(table):
            panels.setdefault((row["task"], row["team"]), []).append(row)
    return panels


def draw(experiment: Path, panels: dict[Panel, list[dict[str, str]]]) -> None:
    """One panel a team: a line with its interval for each seed, dots for the random policy."""
    size = (5 * len(panels), 3.5)
    figure, axes = plt.subplots(
        1, len(panels), figsize=size, constrained_layout=True, squeeze=False
    )
    for axis, ((task, team), rows) in zip(axes[0], sorted(panels.items()), strict=True):
        for seed in sorted({row["seed"] for row in rows}):
            policy = numbers(
                row for row in rows if (row["seed"], row["player"]) == (seed, "policy")
            )
            axis.plot(policy["frames"], policy["return"], label=f"PPO, seed {seed}")
            axis.fill_between(
                policy["frames"], policy["return_low"], policy["return_high"], alpha=0.25
            )
        chance = numbers(row for row in rows if row["player"] == "random")["return"]
        axis.axhline(sum(chance) / len(chance), color="grey", ls=":", label="random policy")
        axis.set(title=f"{task}: {team}", xlabel="frames of experience", ylabel="return")
        axis.legend(frameon=False)
    figure.savefig(experiment / "curves.png", dpi=120)


def numbers(rows) -> dict[str, list[float]]:
    """Return the columns that are drawn."""
    rows = list(rows)
    names = ("frames", "return", "return_low", "return_high")
    return {name: [float(row[name]) for row in rows] for name in names}


def tell(panels: dict[Panel, list[dict[str, str]]]) -> None:
    """Print the first row of chance and the last of the policy for each seed, as Markdown."""
    print("| task | team | seed | frames | PPO | random policy |\n|---|---|---|---|---|---|")
    for (task, team), rows in sorted(panels.items()):
        for seed in sorted({row["seed"] for row in rows}):
            mine = [row for row in rows if row["seed"] == seed]
            last = max(mine, key=lambda row: int(row["frames"]))
            cells = [interval(last), interval(next(r for r in mine if r["player"] == "random"))]
            print(f"| {task} | {team} | {seed} | {last['frames']} | {' | '.join(cells)} |")


def interval(row: dict[str, str]) -> str:
    mean, low, high = (float(row[name]) for name in ("return", "return_low", "return_high"))
    return f"{mean:.2f} [{low:.2f}, {high:.2f}]"


if __name__ == "__main__":
    folder, *runs = map(Path, sys.argv[1:])
    if runs:
        gather(folder, runs)
    panels = read(folder)
    draw(folder, panels)
    tell(panels)
