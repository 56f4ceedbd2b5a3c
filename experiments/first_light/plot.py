"""Gather the evaluations of the runs, draw the curves and print the table of the verdict.

python experiments/first_light/plot.py RUN_FOLDER ...   # gather into results.csv, then draw
python experiments/first_light/plot.py                  # draw from results.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import yaml

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
RESULTS = HERE / "results.csv"
COLUMNS = ["audio", "seed", "player", "frames", "return", "kick", "approach"]
COLOURS = {"hrtf": "tab:blue", "stereo": "tab:green", "mono": "tab:orange"}


def gather(folders: list[Path]) -> None:
    """Write the evaluations of all run folders into one tidy table."""
    rows = []
    for folder in folders:
        config = yaml.safe_load((folder / "config.yaml").read_text())
        audio = config["senses"]["audio"]["quality"]
        with (folder / "evaluations.csv").open() as table:
            for row in csv.DictReader(table):
                rows.append({"audio": audio, "seed": config["seed"], **row})
    with RESULTS.open("w", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda r: (r["audio"], r["seed"], int(r["frames"]))))


def read() -> list[dict[str, str]]:
    with RESULTS.open() as table:
        return list(csv.DictReader(table))


def curves(rows: list[dict[str, str]], audio: str) -> tuple[np.ndarray, np.ndarray]:
    """Return frames ``(T,)`` and returns ``(seeds, T)`` of the policies with one kind of ears."""
    chosen = [row for row in rows if row["audio"] == audio and row["player"] == "policy"]
    seeds = sorted({row["seed"] for row in chosen})
    frames = sorted({int(row["frames"]) for row in chosen})
    by_key = {(row["seed"], int(row["frames"])): float(row["return"]) for row in chosen}
    return np.array(frames), np.array([[by_key[s, f] for f in frames] for s in seeds])


def draw(rows: list[dict[str, str]]) -> None:
    figure, axes = plt.subplots(figsize=(7, 4), constrained_layout=True)
    random = np.mean([float(row["return"]) for row in rows if row["player"] == "random"])
    axes.axhline(random, color="grey", ls=":", label="random policy")
    for audio in sorted({row["audio"] for row in rows}):
        frames, returns = curves(rows, audio)
        axes.plot(frames, returns.T, color=COLOURS[audio], lw=0.7, alpha=0.6)
        label = f"{audio} (mean of {len(returns)} seeds)"
        axes.plot(frames, returns.mean(0), color=COLOURS[audio], lw=2.2, label=label)
    axes.set(
        xlabel="frames of experience", ylabel="return of an evaluation episode", xlim=(0, None)
    )
    axes.legend(frameon=False)
    axes.set_title("KickTheBall, single_room, PPO", fontsize=10)
    figure.savefig(HERE / "curves.png", dpi=130)


def table(rows: list[dict[str, str]]) -> str:
    """Return the verdict's table: the last three evaluations of every run."""
    lines = ["| audio | seed | return | kicks per episode |", "|---|---|---|---|"]
    runs = sorted({(row["audio"], row["seed"]) for row in rows})
    for audio, seed in runs:
        own = [r for r in rows if (r["audio"], r["seed"]) == (audio, seed)]
        last = sorted((r for r in own if r["player"] == "policy"), key=lambda r: int(r["frames"]))[
            -3:
        ]
        returns = np.mean([float(r["return"]) for r in last])
        kicks = np.mean([float(r["kick"]) for r in last])
        lines.append(f"| {audio} | {seed} | {returns:.2f} | {kicks:.2f} |")
    random = [row for row in rows if row["player"] == "random"]
    returns = np.mean([float(r["return"]) for r in random])
    kicks = np.mean([float(r["kick"]) for r in random])
    lines.append(f"| (random policy) | | {returns:.2f} | {kicks:.2f} |")
    return "\n".join(lines)


def main() -> None:
    if len(sys.argv) > 1:
        gather([Path(argument) for argument in sys.argv[1:]])
    rows = read()
    draw(rows)
    print(table(rows))


if __name__ == "__main__":
    main()
