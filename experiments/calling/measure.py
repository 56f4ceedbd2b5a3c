"""Let the experts of MultiAgentNav play with and without voices, and with worse ears.

python experiments/calling/measure.py

Prints the table and writes results.csv. All arms start the same games, so that an arm's time is
compared with that of "voices" game by game.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from veca_marl.config import compose
from veca_marl.envs.game import Game

HERE = Path(__file__).parent
COLUMNS = (
    *("agents", "arm", "episodes", "solved", "solved_low", "solved_high"),
    *("seconds", "seconds_interval", "longer", "longer_interval"),
)
NORMAL_95 = 1.96
LIMIT_S = 12.0  # the task's own
PATIENCE_S = 60.0  # but here they go on

ARMS = {
    "voices": [],
    "finder muted": ["task.muted=finder"],
    "everybody muted": ["task.muted=everybody"],
    "deaf": ["senses/audio=deaf"],
    "mono": ["senses/audio=mono"],
    "stereo": ["senses/audio=stereo"],
}


def seconds_needed(game: Game, seed: int) -> float:
    """Return when all had come to the object, or that the patience was at its end."""
    rng = np.random.default_rng([2026, seed])
    game.reset(rng)
    while True:
        rows = {
            player.name: player.body.encode(game.task.expert(player, game.observe(player)))
            for player in game.players
        }
        if game.step(rows, rng).done:
            return game.steps * game.world.clock.step_s


def play(agents: int, arm: str, episodes: int) -> NDArray[np.float64]:
    # the experts ask `is_visible`: eyes and skin are shut to save time
    shut = ["senses/vision=blind", "senses/touch=numb", f"task.max_seconds={PATIENCE_S}"]
    game = Game(compose(["+task=MultiAgentNav", f"task.agents={agents}", *shut, *ARMS[arm]]).game)
    times = np.array([seconds_needed(game, seed) for seed in range(episodes)])
    game.close()
    return times


def wilson(share: float, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    z = NORMAL_95
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    return middle - half, middle + half


def mean(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the mean and half its 95 % interval."""
    return float(values.mean()), float(NORMAL_95 * values.std(ddof=1) / math.sqrt(len(values)))


def row(
    agents: int, arm: str, times: NDArray[np.float64], voices: NDArray[np.float64]
) -> dict[str, object]:
    solved = float((times <= LIMIT_S).mean())
    numbers = (solved, *wilson(solved, len(times)), *mean(times), *mean(times - voices))
    cells = (agents, arm, len(times), *(round(float(number), 3) for number in numbers))
    return dict(zip(COLUMNS, cells, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="*", default=[2, 3, 4])
    parser.add_argument("--arms", nargs="*", default=list(ARMS), choices=list(ARMS))
    parser.add_argument("--episodes", type=int, default=60)
    asked = parser.parse_args()
    with (HERE / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for agents in asked.agents:
            voices = play(agents, "voices", asked.episodes)
            for arm in asked.arms:
                times = voices if arm == "voices" else play(agents, arm, asked.episodes)
                cells = row(agents, arm, times, voices)
                table.writerow(cells)
                file.flush()
                print(*cells.values(), sep="\t", flush=True)


if __name__ == "__main__":
    main()
