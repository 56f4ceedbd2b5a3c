"""Search for a crawling gait that reaches places in all directions, or that moves backwards.

pip install cmaes
python experiments/crawl/search.py --minutes 30        # starts from the present gait
python experiments/crawl/search.py --back --minutes 30
python experiments/crawl/search.py --measure           # measures the present gaits

The search is an evolution strategy (SepCMA: Ros and Hansen 2008). A gait is evaluated on two
bodies, one with position control and one with torque control; within a generation all gaits have
the same starts. The result is printed. It has the lag of the thighs of the gait at the beginning;
`phase.py` measures its own.
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
from veca_marl.envs.experts.control.crawl_gait import BACK, CRAWL, CrawlGait, GaitPattern
from veca_marl.envs.experts.control.locomotion import bearing_rad
from veca_marl.sim.body.humanoid import JointCommand
from veca_marl.sim.geometry import Floats

BODIES = ("mitten_position", "mitten")
POPULATION = 14
WAY_S, ROUND_S, BACK_S = 8.0, 5.0, 4.0
AHEAD_S = 2.0  # longest time of crawling forwards before moving backwards
STEPS = {
    "_hz": 0.15,
    "_rad": 0.3,
    "_s": 0.05,
    "shortening": 0.25,
}  # standard deviations of the search by the ends of names
DEGREES = 7.0  # standard deviation of all other parameters, which are angles
MEASURED = "thigh_lag_rad"  # no parameter of the motion: no score depends on it
FALLEN = 0.5  # cosine of the angle between the front of the chest and straight down after a fall
Numbers = dict[str, float]


def numbers_of(pattern: Any, name: str = "") -> Numbers:
    """Return all numbers of a gait that the search varies, by their path in it."""
    if isinstance(pattern, float):
        return {} if name.endswith(MEASURED) else {name: pattern}
    found: Numbers = {}
    for key, part in parts_of(pattern).items():
        found |= numbers_of(part, f"{name}/{key}")
    return found


def pattern_of(numbers: Numbers, like: Any, name: str = "") -> Any:
    """Return a copy of a gait with other numbers."""
    if isinstance(like, float):
        return numbers.get(name, like)
    parts = {
        key: pattern_of(numbers, part, f"{name}/{key}") for key, part in parts_of(like).items()
    }
    return parts if isinstance(like, Mapping) else type(like)(**parts)


def parts_of(pattern: Any) -> dict[str, Any]:
    if is_dataclass(pattern):
        return {field.name: getattr(pattern, field.name) for field in fields(pattern)}
    return dict(pattern)


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
        self.step_s = self._game.world.clock.step_s

    def way_mps(self, pattern: GaitPattern, aside_rad: float, seed: int) -> tuple[float, float]:
        """Crawl towards a distant place for a time.

        Returns:
            Speed towards it, and the penalty of rotations and tilts of the trunk.
        """
        crawl = self.start(pattern, seed)
        start, ahead = self._line()
        c, s = math.cos(aside_rad), math.sin(aside_rad)
        way = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
        spin, least = 0.0, 1.0
        steps = round(WAY_S / self.step_s)
        for _ in range(steps):
            self.step(crawl.towards(bearing_rad(self.body, start + 100.0 * way)))
            spin += self._spin() / steps
            least = min(least, self.face_down())
        speed = float((self.body.position[:2] - start) @ way) / WAY_S
        return speed, self._penalty(spin, least)

    def back_mps(self, pattern: GaitPattern, ahead_s: float, seed: int) -> tuple[float, float]:
        """Crawl forwards with the present gait, then backwards; return speed and penalty."""
        crawl = self.start(CRAWL, seed)
        for _ in range(round(ahead_s / self.step_s)):
            self.step(crawl.command())
        crawl, start, ahead = CrawlGait(self.body, self.step_s, pattern), *self._line()
        spin, least = 0.0, 1.0
        steps = round(BACK_S / self.step_s)
        for _ in range(steps):
            self.step(crawl.command())
            spin += self._spin() / steps
            least = min(least, self.face_down())
        speed = float((start - self.body.position[:2]) @ ahead) / BACK_S
        return speed, self._penalty(spin, least)

    def round_rad(self, pattern: GaitPattern, turn: float, seed: int) -> tuple[float, float]:
        """Turn to one side for a time; return the angle, and the greatest distance in metres."""
        crawl = self.start(pattern, seed)
        before, start = self.body.forward, self.body.position[:2]
        turned, away = 0.0, 0.0
        for _ in range(round(ROUND_S / self.step_s)):
            self.step(crawl.command(turn))
            now = self.body.forward
            turned += math.atan2(before[0] * now[1] - before[1] * now[0], float(before @ now))
            before, away = now, max(away, math.dist(self.body.position[:2], start))
        return turned * turn, away

    def start(self, pattern: GaitPattern, seed: int) -> CrawlGait:
        self._game.reset(np.random.default_rng([2026, seed]))
        return CrawlGait(self.body, self.step_s, pattern)

    def step(self, command: JointCommand) -> None:
        self.body.act(self.body.encode(command))
        self._game.advance()

    def _line(self) -> tuple[Floats, Floats]:
        """Return position and heading, ``(2,)`` each."""
        return self.body.position[:2], self.body.forward[:2]

    def _spin(self) -> float:
        """Return the angular speed of the chest, rad/s."""
        return float(np.linalg.norm(self.body.angular_velocities()[self._chest]))

    def _penalty(self, spin: float, least: float) -> float:
        side = 0.15 * max(0.0, 0.8 - least) + 0.2 * max(0.0, 0.7 - self.face_down())
        return 0.02 * spin + side

    def face_down(self) -> float:
        """Return the cosine of the angle between the front of the chest and straight down."""
        return -float(self.body.bone("chest").forward[2])


def ahead(trial: Trial, pattern: GaitPattern, side: float, rng: np.random.Generator) -> list[float]:
    """Return scores of a gait for reaching places and turning, in m/s or weighted likewise."""
    scores = []
    for low, high, hand in ((0.0, 60.0, side), (60.0, 150.0, -side)):
        aside_rad = hand * math.radians(rng.uniform(low, high))
        speed, penalty = trial.way_mps(pattern, aside_rad, int(rng.integers(10**6)))
        scores.append(speed - penalty)
    turned, away = trial.round_rad(pattern, side, int(rng.integers(10**6)))
    return [*scores, 0.3 * min(1.0, turned / math.pi) - 0.15 * max(0.0, away - 0.5)]


def back(trial: Trial, pattern: GaitPattern, side: float, rng: np.random.Generator) -> list[float]:
    """Return scores of a gait for moving backwards, m/s."""
    del side
    tries = [(float(rng.uniform(0.0, AHEAD_S)), int(rng.integers(10**6))) for _ in range(2)]
    return [float(np.subtract(*trial.back_mps(pattern, *one))) for one in tries]


Evaluation = Callable[[Trial, GaitPattern, float, np.random.Generator], list[float]]


def score(
    trials: list[Trial], evaluate: Evaluation, pattern: GaitPattern, generation: int
) -> float:
    """Return the mean of all scores plus half of the lowest."""
    rng, found = np.random.default_rng([7, generation]), []
    for number, trial in enumerate(trials):
        side = 1.0 if (generation + number) % 2 else -1.0
        found += evaluate(trial, pattern, side, rng)
    return float(np.mean(found) + 0.5 * min(found))


def search(known: GaitPattern, evaluate: Evaluation, minutes: float) -> GaitPattern:
    from cmaes import SepCMA  # needed by this search only

    begin = numbers_of(known)
    steps = np.array([step_of(name) for name in begin])
    trials = [Trial(body) for body in BODIES]
    strategy = SepCMA(np.zeros(len(begin)), 0.5, population_size=POPULATION, seed=0)

    def pattern_at(point: Any) -> GaitPattern:
        numbers = np.array(list(begin.values())) + steps * point
        found: GaitPattern = pattern_of(dict(zip(begin, numbers.tolist(), strict=True)), known)
        return found

    started = time.monotonic()
    while time.monotonic() - started < 60.0 * minutes:
        generation = strategy.generation
        points = [strategy.ask() for _ in range(POPULATION)]
        scores = [score(trials, evaluate, pattern_at(point), generation) for point in points]
        strategy.tell([(point, -won) for point, won in zip(points, scores, strict=True)])
        print(generation, f"best {max(scores):.3f} mean {np.mean(scores):.3f}", flush=True)
    return pattern_at(strategy.mean)


def measure() -> None:
    """Print measurements of the gaits on the bodies of the search and on others."""
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
    parser.add_argument(
        "--back", action="store_true", help="search for a gait that moves backwards"
    )
    parser.add_argument("--measure", action="store_true")
    asked = parser.parse_args()
    if asked.measure:
        measure()
    else:
        known, evaluate = (BACK, back) if asked.back else (CRAWL, ahead)
        pprint(search(known, evaluate, asked.minutes))


if __name__ == "__main__":
    main()
