"""Measure the phase of the crawling gaits before that of the thighs.

    python experiments/crawl/phase.py

Prints for each body and gait the circular mean of the lag (`GaitPattern.thigh_lag_rad`), and the
circular standard deviation over steps, which is the error of the phase that `CrawlGait.follow_body`
sets.
"""

import math

import numpy as np
from search import Trial

from veca_marl.envs.experts.control.crawl_gait import BACK, CRAWL, CrawlGait

SETTLED_S, MEASURED_S, STARTS = 1.6, 6.0, 5


def lags(trial: Trial, pattern) -> list[complex]:
    """Return the lag in each step of some starts, as numbers of magnitude 1."""
    found = []
    for seed in range(STARTS):
        gait, step_s = trial.start(CRAWL, seed), trial.step_s
        if pattern is not CRAWL:
            for _ in range(round(1.0 / step_s)):
                trial.step(gait.command())
            gait = CrawlGait(trial.body, step_s, pattern)
        for step in range(round((SETTLED_S + MEASURED_S) / step_s)):
            if step * step_s >= SETTLED_S:
                lag_rad = pattern.thigh_lag_rad - gait.followed_rad() + gait.phase_rad
                found.append(np.exp(1j * lag_rad))
            trial.step(gait.command())
    return found


for name in ("mitten", "mitten_limbs", "full", "mitten_position"):
    body = Trial(name)
    for label, pattern in (("ahead", CRAWL), ("backwards", BACK)):
        mean = np.mean(lags(body, pattern))
        spread = math.sqrt(-2.0 * math.log(abs(mean)))
        print(f"{name:16} {label:10} lag {np.angle(mean):6.2f} rad, deviation {spread:.2f} rad")
