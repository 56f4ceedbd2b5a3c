"""Search for a rhythm of crawling that gets to places all around, or straight back, and print it.

pip install cmaes
python experiments/crawl/search.py --minutes 30        # goes on from the rhythm that there is
python experiments/crawl/search.py --back --minutes 30
python experiments/crawl/search.py --measure           # what the rhythms do, without a search

The search is an evolution strategy (SepCMA: Ros and Hansen 2008). A rhythm is tried on two bodies,
one driven by target angles and one by torques; in each generation all are tried from the same
starts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pprint import pprint
from typing import Any

import numpy as np

from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.experts.control.crawl_gait import CrawlGait
from veca_marl.envs.experts.control.gait_patterns import BACK, CRAWL, GaitPattern
from veca_marl.envs.experts.control.steering import bearing_rad
from veca_marl.sim.body.humanoid import JointCommand
from veca_marl.sim.geometry import Floats

BODIES = ("mitten_position", "mitten")
POPULATION = 14
WAY_S, ROUND_S, BACK_S = 8.0, 5.0, 4.0
AHEAD_S = 2.0  # who goes back has crawled ahead for so long at most
STEPS = {
    "_hz": 0.15,
    "_rad": 0.3,
    "_s": 0.05,
    "shortening": 0.25,
}  # of the search, by name; degrees:
DEGREES = 7.0
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
        self._chest = self.body.bone_names.index("chest")
        self._step_s = self._game.world.clock.step_s

    def way_mps(self, rhythm: GaitPattern, aside_rad: float, seed: int) -> tuple[float, float]:
        """CrawlGait for some time to a place far away.

        Returns:
            Speed towards it; what it costs that the trunk was in turmoil or came to lie on its
            side.
        """
        crawl = self._start(rhythm, seed)
        start, ahead = self._line()
        c, s = math.cos(aside_rad), math.sin(aside_rad)
        way = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
        spin, least = 0.0, 1.0
        steps = round(WAY_S / self._step_s)
        for _ in range(steps):
            self._step(crawl.towards(bearing_rad(self.body, start + 100.0 * way)))
            spin += self._spin() / steps
            least = min(least, self.face_down())
        speed = float((self.body.position[:2] - start) @ way) / WAY_S
        return speed, self._turmoil(spin, least)

    def back_mps(self, rhythm: GaitPattern, horizon_s: float, seed: int) -> tuple[float, float]:
        """CrawlGait ahead as it is known, then back; return speed back and turmoil."""
        crawl = self._start(CRAWL, seed)
        for _ in range(round(horizon_s / self._step_s)):
            self._step(crawl.command())
        crawl, start, ahead = CrawlGait(self.body, self._step_s, rhythm), *self._line()
        spin, least = 0.0, 1.0
        steps = round(BACK_S / self._step_s)
        for _ in range(steps):
            self._step(crawl.command())
            spin += self._spin() / steps
            least = min(least, self.face_down())
        speed = float((start - self.body.position[:2]) @ ahead) / BACK_S
        return speed, self._turmoil(spin, least)

    def round_rad(self, rhythm: GaitPattern, turn: float, seed: int) -> tuple[float, float]:
        """Turn for some time to one side; return how far, and how far away it came, metres."""
        crawl = self._start(rhythm, seed)
        before, start = self.body.forward, self.body.position[:2]
        turned, away = 0.0, 0.0
        for _ in range(round(ROUND_S / self._step_s)):
            self._step(crawl.command(turn))
            now = self.body.forward
            turned += math.atan2(before[0] * now[1] - before[1] * now[0], float(before @ now))
            before, away = now, max(away, math.dist(self.body.position[:2], start))
        return turned * turn, away

    def _start(self, rhythm: GaitPattern, seed: int) -> CrawlGait:
        self._game.reset(np.random.default_rng([2026, seed]))
        return CrawlGait(self.body, self._step_s, rhythm)

    def _step(self, wish: JointCommand) -> None:
        self.body.act(self.body.encode(wish))
        self._game.advance()

    def _line(self) -> tuple[Floats, Floats]:
        """Return where it is and whither it faces, ``(2,)`` each."""
        return self.body.position[:2], self.body.forward[:2]

    def _spin(self) -> float:
        """Return how fast the chest turns, rad/s."""
        return float(np.linalg.norm(self.body.angular_velocities()[self._chest]))

    def _turmoil(self, spin: float, least: float) -> float:
        side = 0.15 * max(0.0, 0.8 - least) + 0.2 * max(0.0, 0.7 - self.face_down())
        return 0.02 * spin + side

    def face_down(self) -> float:
        """Return the cosine of the angle between the front of the chest and straight down."""
        return -float(self.body.bone("chest").forward[2])


def ahead(trial: Trial, rhythm: GaitPattern, side: float, rng: np.random.Generator) -> list[float]:
    """Return what a rhythm is worth that gets to places and turns: m/s, or worth as much."""
    worth = []
    for low, high, hand in ((0.0, 60.0, side), (60.0, 150.0, -side)):
        aside_rad = hand * math.radians(rng.uniform(low, high))
        speed, turmoil = trial.way_mps(rhythm, aside_rad, int(rng.integers(10**6)))
        worth.append(speed - turmoil)
    turned, away = trial.round_rad(rhythm, side, int(rng.integers(10**6)))
    return [*worth, 0.3 * min(1.0, turned / math.pi) - 0.15 * max(0.0, away - 0.5)]


def back(trial: Trial, rhythm: GaitPattern, side: float, rng: np.random.Generator) -> list[float]:
    """Return what a rhythm is worth that leads back."""
    del side
    tries = [(float(rng.uniform(0.0, AHEAD_S)), int(rng.integers(10**6))) for _ in range(2)]
    return [float(np.subtract(*trial.back_mps(rhythm, *one))) for one in tries]


Worth = Callable[[Trial, GaitPattern, float, np.random.Generator], list[float]]


def score(trials: list[Trial], worth: Worth, rhythm: GaitPattern, generation: int) -> float:
    """Return the mean of all tries and, besides, half of the worst."""
    rng, found = np.random.default_rng([7, generation]), []
    for number, trial in enumerate(trials):
        side = 1.0 if (generation + number) % 2 else -1.0
        found += worth(trial, rhythm, side, rng)
    return float(np.mean(found) + 0.5 * min(found))


def search(known: GaitPattern, worth: Worth, minutes: float) -> GaitPattern:
    from cmaes import SepCMA  # of nobody else's need

    begin = numbers_of(known)
    steps = np.array([step_of(name) for name in begin])
    trials = [Trial(body) for body in BODIES]
    strategy = SepCMA(np.zeros(len(begin)), 0.5, population_size=POPULATION, seed=0)

    def rhythm_at(point: Any) -> GaitPattern:
        numbers = np.array(list(begin.values())) + steps * point
        found: GaitPattern = rhythm_of(dict(zip(begin, numbers.tolist(), strict=True)), known)
        return found

    started = time.monotonic()
    while time.monotonic() - started < 60.0 * minutes:
        generation = strategy.generation
        points = [strategy.ask() for _ in range(POPULATION)]
        scores = [score(trials, worth, rhythm_at(point), generation) for point in points]
        strategy.tell([(point, -won) for point, won in zip(points, scores, strict=True)])
        print(generation, f"best {max(scores):.3f} mean {np.mean(scores):.3f}", flush=True)
    return rhythm_at(strategy.mean)


def measure() -> None:
    """Print what the rhythms do on bodies, those that they were found on and others."""
    for body in (*BODIES, "full", "full_position"):
        trial = Trial(body)
        for degrees in (0, 60, -60, 120, -120):
            ways, upright = [], 0
            for seed in range(5):
                ways.append(trial.way_mps(CRAWL, math.radians(degrees), seed)[0])
                upright += trial.face_down() > FALLEN
            print(
                f"{body:16}to {degrees:4} degrees aside: {np.mean(ways):.2f} m/s, {upright} of 5 "
                f"on their knees at the end; {np.round(ways, 2)}"
            )
        for turn in (1.0, -1.0):
            rounds = [trial.round_rad(CRAWL, turn, seed) for seed in range(5)]
            turned, away = np.mean(rounds, axis=0)
            speed = math.degrees(turned) / ROUND_S
            print(f"{body:16}turn {turn:2}: {speed:.0f} degrees/s, {away:.2f} m away at most")
        ways, upright = [], 0
        for seed in range(10):
            ways.append(trial.back_mps(BACK, AHEAD_S * seed / 9, seed)[0])
            upright += trial.face_down() > FALLEN
        print(
            f"{body:16}back: {np.mean(ways):.2f} m/s, {upright} of 10 on their knees at the end; "
            f"{np.round(ways, 2)}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--back", action="store_true", help="search for one that leads back")
    parser.add_argument("--measure", action="store_true")
    asked = parser.parse_args()
    if asked.measure:
        measure()
    else:
        known, worth = (BACK, back) if asked.back else (CRAWL, ahead)
        pprint(search(known, worth, asked.minutes))


if __name__ == "__main__":
    main()
