"""Gather the evaluations of the runs and draw the curves.

python experiments/first_moves/plot.py RUN_FOLDER ...   # gather into results.csv, then draw
python experiments/first_moves/plot.py                  # draw from results.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib as mpl
import yaml

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
RESULTS = HERE / "results.csv"
COLUMNS = ["task", "seed", "player", "frames", "return", "return_low", "return_high"]
COLUMNS += ["torso", "hip", "head"]


def gather(folders: list[Path]) -> None:
    """Write the evaluations of all run folders into one table."""
    rows = []
    for folder in folders:
        config = yaml.safe_load((folder / "config.yaml").read_text())
        with (folder / "evaluations.csv").open() as table:
            for row in csv.DictReader(table):
                rows.append({"task": config["task"]["name"], "seed": config["seed"], **row})
    with RESULTS.open("w", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def draw() -> None:
    """One panel a task: the policy with its interval, and the random policy."""
    with RESULTS.open() as table:
        rows = list(csv.DictReader(table))
    tasks = sorted({row["task"] for row in rows})
    figure, panels = plt.subplots(1, len(tasks), figsize=(9, 3.5), constrained_layout=True)
    for axes, task in zip(panels, tasks, strict=True):
        for seed in sorted({row["seed"] for row in rows}):
            chosen = [row for row in rows if (row["task"], row["seed"]) == (task, seed)]
            policy = [row for row in chosen if row["player"] == "policy"]
            frames = [int(row["frames"]) for row in policy]
            low, mean, high = (
                [float(row[key]) for row in policy]
                for key in ("return_low", "return", "return_high")
            )
            axes.plot(frames, mean, label=f"PPO, seed {seed}")
            axes.fill_between(frames, low, high, alpha=0.25)
            for row in chosen:
                if row["player"] == "random":
                    axes.axhline(float(row["return"]), color="grey", ls=":", label="random policy")
        axes.set(title=task, xlabel="frames of experience", ylabel="return of an episode")
        axes.legend(loc="lower right")
    figure.savefig(HERE / "curves.png", dpi=120)


if __name__ == "__main__":
    if folders := [Path(argument) for argument in sys.argv[1:]]:
        gather(folders)
    draw()
