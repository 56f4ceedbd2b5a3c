"""Write rliable.json: what rliable 1.2.0 computes for a few scores.

rliable cannot be installed beside this project: it needs older versions of arch and pandas. In an
environment of its own (``pip install rliable==1.2.0 "pandas<3"``):
``python tests/reports/rliable_values.py``.
"""

import json
from pathlib import Path

import numpy as np
from rliable import library, metrics

RESAMPLES = 20_000


def intervals(scores, aggregate):
    _, found = library.get_interval_estimates(
        scores, aggregate, reps=RESAMPLES, random_state=np.random.RandomState(0)
    )
    return [round(float(end), 6) for end in found["case"].ravel()]


def case(name, one, other):
    improvement = metrics.probability_of_improvement
    return {
        "name": name,
        "one": one.tolist(),
        "other": other.tolist(),
        "iqm": float(metrics.aggregate_iqm(one)),
        "iqm_interval": intervals({"case": one}, lambda x: np.array([metrics.aggregate_iqm(x)])),
        "improvement": float(improvement(one, other)),
        "improvement_interval": intervals(
            {"case": (one, other)}, lambda x, y: np.array([improvement(x, y)])
        ),
    }


def main():
    rng = np.random.default_rng(2026)
    cases = [
        case("ten runs", rng.normal(6, 1, (10, 1)).round(3), rng.normal(5, 1, (10, 1)).round(3)),
        case("three runs", rng.normal(6, 1, (3, 1)).round(3), rng.normal(5.5, 1, (4, 1)).round(3)),
        case("four tasks", rng.normal(0, 1, (5, 4)).round(3), rng.normal(0.3, 1, (5, 4)).round(3)),
        case("equal", np.ones((5, 1)), np.ones((5, 1))),
    ]
    path = Path(__file__).parent / "rliable.json"
    path.write_text(json.dumps(cases, indent=1) + "\n")


if __name__ == "__main__":
    main()
