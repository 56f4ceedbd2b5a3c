"""Small run folders, as training leaves them."""

import csv
import json

import yaml

from veca_marl import api

TINY = (
    "algo.minibatches=2",
    "algo.epochs=1",
    "collect=one_process",
    "collect.worlds=1",
    "collect.steps=4",
    "eval.every_frames=4",
    "eval.episodes=1",
    "eval.worlds=1",
    "task.max_seconds=0.2",
    "threads=1",
)


def train_tiny(folder, frames, *log):
    """Train PPO on KickTheBall for some frames, by ears only; return the folder of the run."""
    senses = {"vision": "blind", "touch": "numb"}
    api.train(
        "KickTheBall", total_frames=frames, senses=senses, folder=folder, overrides=[*TINY, *log]
    )
    return folder


def write_run(folder, config, evaluations, ended=True, seconds_per_frame=0.01, random=-0.5):
    """Write a run folder.

    Args:
        folder: The folder.
        config: The configuration as plain data.
        evaluations: Pairs of frames and return.
        ended: Whether the run has ended.
        seconds_per_frame: Time of collection and learning.
        random: Return of the random policy.
    """
    folder.mkdir(parents=True)
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    (folder / "provenance.json").write_text(json.dumps({"commit": "abc", "packages": {}}))
    common = {"team": "agents", "episodes": 32}
    scores = [(0, "random", random), *((at, "policy", score) for at, score in evaluations)]
    table(
        folder / "evaluations.csv",
        [{"frames": f, "player": p, **common, "return": s} for f, p, s in scores],
    )
    rate = 1.0 / seconds_per_frame
    table(folder / "metrics.csv", [{"frames": f, "frames_per_s": rate} for f, _ in evaluations])
    progress = {"frames": max(frames for frames, _, _ in scores), "ended": ended}
    (folder / "progress.json").write_text(json.dumps(progress))
    if ended:
        (folder / "comparison.txt").write_text("agents: ...\n")


def table(path, rows):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
