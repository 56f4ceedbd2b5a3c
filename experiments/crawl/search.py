"""Search for a rhythm of crawling that gets to places all around, and print it.

pip install cmaes
python experiments/crawl/search.py --minutes 30        # goes on from the rhythm that there is
python experiments/crawl/search.py --measure           # what that rhythm does, without a search

The search is an evolution strategy (SepCMA: Ros and Hansen 2008). A rhythm is tried on two bodies,
one driven by target angles and one by torques; in each generation all are tried from the same
starts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pprint import pprint
from typing import Any

import numpy as np

from veca_marl.config import compose
from veca_marl.envs.experts.crawl import CRAWL, Crawl, Rhythm
from veca_marl.envs.experts.walking import bearing_rad
from veca_marl.envs.game import Game

BODIES = ("mitten_position", "mitten")
POPULATION = 14
WAY_S, ROUND_S = 8.0, 5.0
STEPS = {
    "_hz": 0.15,
    "_rad": 0.3,
    "_s": 0.05,
    "shortening": 0.25,
}  # of the search, by name; degrees:
DEGREES = 7.0
GAZE_DEG = -20.0  # who looks lower does not see where it goes
FALLEN = 0.5  # cosine of the chest's front with straight down: less is on the side or the back
Numbers = dict[str, float]


def numbers_of(rhythm: Any, name: str = "") -> Numbers:
    """Return all numbers of a rhythm by their place in it."""
    if isinstance(rhythm, float):
        return {name: rhythm}
    found: Numbers = {}
    for key, part in parts_of(rhythm).items():
        found |= numbers_of(part, f"{name}/{key}")
    return found


def rhythm_of(numbers: Numbers, like: Any, name: str = "") -> Any:
    """Return a rhythm like another one, with other numbers."""
    if isinstance(like, float):
        return numbers[name]
    parts = {key: rhythm_of(numbers, part, f"{name}/{key}") for key, part in parts_of(like).items()}
    return parts if isinstance(like, Mapping) else type(like)(**parts)


def parts_of(rhythm: Any) -> dict[str, Any]:
    if is_dataclass(rhythm):
        return {field.name: getattr(rhythm, field.name) for field in fields(rhythm)}
    return dict(rhythm)


def step_of(name: str) -> float:
    return next((step for end, step in STEPS.items() if name.endswith(end)), DEGREES)


class Trial:
    """A world in which one body crawls.

    Args:
        body: The name of a preset.
    """

    def __init__(self, body: str) -> None:
        shut = ("senses/vision=blind", "senses/audio=deaf", "senses/touch=numb")
        self._game = Game(compose(["+task=CrawlBaby", f"body={body}", *shut]).game)
        self.body = self._game.players[0].body
        self._step_s = self._game.world.clock.step_s

    def way_mps(self, rhythm: Rhythm, aside_rad: float, seed: int) -> tuple[float, float]:
        """Crawl for some time to a place far away.

        Returns:
            Speed towards it; what it costs that the trunk was in turmoil or came to lie on its
            side, or that the eyes looked at the floor.
        """
        crawl, rng = self._start(rhythm, seed)
        ahead, start = self.body.forward[:2], self.body.position[:2]
        c, s = math.cos(aside_rad), math.sin(aside_rad)
        way = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
        chest = self.body.bone_names.index("chest")
        spin, least, lowered = 0.0, 1.0, 0.0
        steps = round(WAY_S / self._step_s)
        for _ in range(steps):
            wish = crawl.towards(bearing_rad(self.body, start + 100.0 * way))
            self.body.act(self.body.encode(wish))
            self._game.advance(rng)
            spin += float(np.linalg.norm(self.body.angular_velocities()[chest])) / steps
            least = min(least, self.face_down())
            lowered += max(0.0, GAZE_DEG - self._gaze_deg()) / steps
        turmoil = (
            0.02 * spin + 0.15 * max(0.0, 0.8 - least) + 0.2 * max(0.0, 0.7 - self.face_down())
        )
        return float((self.body.position[:2] - start) @ way) / WAY_S, turmoil

    def round_rad(self, rhythm: Rhythm, turn: float, seed: int) -> tuple[float, float]:
        """Turn for some time to one side; return how far, and how far away it came, metres."""
        crawl, rng = self._start(rhythm, seed)
        before, start = self.body.forward, self.body.position[:2]
        turned, away = 0.0, 0.0
        for _ in range(round(ROUND_S / self._step_s)):
            self.body.act(self.body.encode(crawl.wish(turn)))
            self._game.advance(rng)
            now = self.body.forward
            turned += math.atan2(before[0] * now[1] - before[1] * now[0], float(before @ now))
            before, away = now, max(away, math.dist(self.body.position[:2], start))
        return turned * turn, away

    def _start(self, rhythm: Rhythm, seed: int) -> tuple[Crawl, np.random.Generator]:
        rng = np.random.default_rng([2026, seed])
        self._game.reset(rng)
        return Crawl(self.body, self._step_s, rhythm), rng

    def _gaze_deg(self) -> float:
        """Return how high above the horizon an eye looks."""
        return math.degrees(math.asin(float(self.body.mount("eye_left").rotation[2, 0])))

    def face_down(self) -> float:
        """Return the cosine of the angle between the front of the chest and straight down."""
        return -float(self.body.bone("chest").forward[2])


def score(trials: list[Trial], rhythm: Rhythm, generation: int) -> float:
    """Return the mean of all tries and, besides, half of the worst: m/s, or worth as much."""
    rng = np.random.default_rng([7, generation])
    worth = []
    for number, trial in enumerate(trials):
        side = 1.0 if (generation + number) % 2 else -1.0
        for low, high, hand in ((0.0, 60.0, side), (60.0, 150.0, -side)):
            aside_rad = hand * math.radians(rng.uniform(low, high))
            speed, turmoil = trial.way_mps(rhythm, aside_rad, int(rng.integers(10**6)))
            worth.append(speed - turmoil)
        turned, away = trial.round_rad(rhythm, side, int(rng.integers(10**6)))
        worth.append(0.3 * min(1.0, turned / math.pi) - 0.15 * max(0.0, away - 0.5))
    return float(np.mean(worth) + 0.5 * min(worth))


def search(minutes: float) -> Rhythm:
    from cmaes import SepCMA  # of nobody else's need

    begin = numbers_of(CRAWL)
    steps = np.array([step_of(name) for name in begin])
    trials = [Trial(body) for body in BODIES]
    strategy = SepCMA(np.zeros(len(begin)), 0.5, population_size=POPULATION, seed=0)

    def rhythm_at(point: Any) -> Rhythm:
        numbers = np.array(list(begin.values())) + steps * point
        found: Rhythm = rhythm_of(dict(zip(begin, numbers.tolist(), strict=True)), CRAWL)
        return found

    started = time.monotonic()
    while time.monotonic() - started < 60.0 * minutes:
        generation = strategy.generation
        points = [strategy.ask() for _ in range(POPULATION)]
        scores = [score(trials, rhythm_at(point), generation) for point in points]
        strategy.tell([(point, -worth) for point, worth in zip(points, scores, strict=True)])
        print(generation, f"best {max(scores):.3f} mean {np.mean(scores):.3f}", flush=True)
    return rhythm_at(strategy.mean)


def measure(rhythm: Rhythm) -> None:
    """Print what a rhythm does on bodies, those that it was found on and others."""
    for body in (*BODIES, "full", "full_position"):
        trial = Trial(body)
        for degrees in (0, 60, -60, 120, -120):
            ways, upright = [], 0
            for seed in range(5):
                ways.append(trial.way_mps(rhythm, math.radians(degrees), seed)[0])
                upright += trial.face_down() > FALLEN
            print(
                f"{body:16}to {degrees:4} degrees aside: {np.mean(ways):.2f} m/s, {upright} of 5 "
                f"on their knees at the end; {np.round(ways, 2)}"
            )
        for turn in (1.0, -1.0):
            rounds = [trial.round_rad(rhythm, turn, seed) for seed in range(5)]
            turned, away = np.mean(rounds, axis=0)
            speed = math.degrees(turned) / ROUND_S
            print(f"{body:16}turn {turn:2}: {speed:.0f} degrees/s, {away:.2f} m away at most")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--measure", action="store_true")
    asked = parser.parse_args()
    if asked.measure:
        measure(CRAWL)
    else:
        pprint(search(asked.minutes))


if __name__ == "__main__":
    main()
