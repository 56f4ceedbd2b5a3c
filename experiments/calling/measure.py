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
Played = NDArray[np.float64]
ARMS = {
    "voices": [],
    "finder muted": ["task.muted=finder"],
    "all deaf": ["senses/audio=deaf"],
    "mono": ["senses/audio=mono"],
    "stereo": ["senses/audio=stereo"],
}
FOR_MORE = ("voices", "finder muted", "all deaf")  # than two agents


def play_once(game: Game, seed: int) -> tuple[bool, float]:
    """Return whether all came to the object in time, and after how many seconds it was over."""
    rng = np.random.default_rng([2026, seed])
    game.reset(rng)
    while True:
        rows = {
            player.name: player.body.encode(game.task.expert(player, game.observe(player)))
            for player in game.players
        }
        outcome = game.step(rows, rng)
        if outcome.done:
            return outcome.terminated, game.steps * game.world.clock.step_s


def play(agents: int, arm: str, episodes: int) -> Played:
    """Return for each episode whether it was solved, and its seconds: ``(episodes, 2)``."""
    # the experts ask `is_visible`: eyes and skin are shut to save time
    shut = ["senses/vision=blind", "senses/touch=numb"]
    game = Game(compose(["+task=MultiAgentNav", f"task.agents={agents}", *shut, *ARMS[arm]]).game)
    played = np.array([play_once(game, seed) for seed in range(episodes)])
    game.close()
    return played


def wilson(share: float, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    z = NORMAL_95
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    return middle - half, middle + half


def mean(values: Played) -> tuple[float, float]:
    """Return the mean and half its 95 % interval."""
    return float(values.mean()), float(NORMAL_95 * values.std(ddof=1) / math.sqrt(len(values)))


def row(agents: int, arm: str, played: Played, voices: Played) -> dict[str, object]:
    solved, seconds = float(played[:, 0].mean()), played[:, 1]
    longer = seconds - voices[:, 1]
    numbers = (solved, *wilson(solved, len(played)), *mean(seconds), *mean(longer))
    cells = (agents, arm, len(played), *(round(float(number), 3) for number in numbers))
    return dict(zip(COLUMNS, cells, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="*", default=[2, 3, 4])
    parser.add_argument("--arms", nargs="*", choices=list(ARMS))
    parser.add_argument("--episodes", type=int, default=30)
    asked = parser.parse_args()
    with (HERE / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for agents in asked.agents:
            voices = play(agents, "voices", asked.episodes)
            for arm in asked.arms or (ARMS if agents == 2 else FOR_MORE):
                played = voices if arm == "voices" else play(agents, arm, asked.episodes)
                cells = row(agents, arm, played, voices)
                table.writerow(cells)
                file.flush()
                print(*cells.values(), sep="\t", flush=True)


if __name__ == "__main__":
    main()
