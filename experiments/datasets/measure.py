"""Make every data set in every quality, train its baseline, and collect the scores.

    python experiments/datasets/measure.py n=4000 epochs=12 runs=1

What `results.json` holds already with the same numbers is not computed again; ``only=NAME``
measures the sets and qualities that begin with a name. The full table needs ``n=80000 epochs=50
runs=5``, which is the default.
"""

import json
import shutil
import sys
from pathlib import Path

from veca_marl.datasets.command import main

HERE = Path(__file__).parent
WORK = Path("datasets")
EYES = ("binocular", "monocular", "grey", "blur")
JOBS = {
    **{f"sound_localisation/{q}": [f"senses/audio={q}"] for q in ("hrtf", "stereo", "mono")},
    "object_recognition/binocular": [],
    "object_classification/binocular": [],
    "contact_localisation/skin": [],
    "contact_localisation/parts": ["senses/touch=parts_only"],
    "contact_localisation/binary": ["senses/touch=binary"],
    "tactile_classification/skin": [],
    **{f"distance_estimation/{q}": [f"senses/vision={q}"] for q in EYES},
    "audiovisual_correspondence/hrtf": [],
    "depth_disparity/binocular": [],
    **{
        f"distance_estimation/infant {age} months": [
            "senses/vision=infant",
            f"senses.vision.infant_age_months={age}.0",
        ]
        for age in (1, 4, 8)
    },
    "audiovisual_correspondence/mono": ["senses/audio=mono"],
    "depth_disparity/monocular": ["senses/vision=monocular"],
    "tactile_classification/parts": ["senses/touch=parts_only"],
    "tactile_classification/binary": ["senses/touch=binary"],
}


def measure(job: str, numbers: dict[str, str], making: list[str]) -> dict:
    """Return the scores of one data set in one quality."""
    dataset, words = job.partition("/")[0], JOBS[job]
    folder, table = WORK / job.replace("/", "-").replace(" ", "_"), WORK / "scores.json"
    make = [f"+dataset={dataset}", *words, f"n={numbers['n']}", f"out={folder}", "progress=false"]
    make += making
    train = [f"data={folder}", f"json={table}", "progress=false"]
    train += [f"{key}={numbers[key]}" for key in ("epochs", "runs", "learning.test_fraction")]
    for command in (["make", *make], ["train", *train]):
        if main(command):
            sys.exit(f"failed: {' '.join(command)}")
    scores = json.loads(table.read_text())
    shutil.rmtree(folder)
    return scores


def tables(results: dict[str, dict]) -> str:
    """Return the table of the results: all data sets, and what the qualities cost."""
    head = "| data set | quality | samples, epochs, runs | scores on the test set | paper |"
    lines = [
        "# Scores of the baselines",
        "",
        "Written by measure.py.",
        "",
        head,
        "|---|---|---|---|---|",
    ]
    for job in (job for job in JOBS if job in results):
        dataset, _, quality = job.partition("/")
        found = results[job]
        numbers = found["numbers"]
        scores = "; ".join(f"{name} {cell(score)}" for name, score in found["scores"].items())
        size = f"{numbers['n']}, {numbers['epochs']}, {numbers['runs']}"
        lines.append(f"| `{dataset}` | {quality} | {size} | {scores} | {found['paper']} |")
    return "\n".join(lines) + "\n"


def cell(score: dict) -> str:
    """Return mean and deviation of a score."""
    spread = "" if score["deviation"] is None else f" +- {score['deviation']:.3f}"
    return f"{score['mean']:.3f}{spread}"


def run(words: list[str]) -> None:
    """Measure all jobs; write the results after each of them."""
    numbers = {"n": "80000", "epochs": "50", "runs": "5", "learning.test_fraction": "0.1"}
    numbers |= dict(word.split("=", 1) for word in words)
    processes = numbers.pop("processes", None)  # the results do not depend on it
    only = numbers.pop("only", "")
    making = [] if processes is None else [f"processes={processes}"]
    path = HERE / "results.json"
    results = json.loads(path.read_text()) if path.exists() else {}
    for job in (job for job in JOBS if job.startswith(only)):
        if results.get(job, {}).get("numbers") != numbers:
            results[job] = {"numbers": numbers, **measure(job, numbers, making)}
            path.write_text(json.dumps(results, indent=1) + "\n")
            (HERE / "tables.md").write_text(tables(results))


if __name__ == "__main__":
    run(sys.argv[1:])
