"""Let the experts of MultiAgentNav play with and without voices, and with degraded hearing.

python experiments/calling/measure.py

Prints the table and writes results.csv. All arms start the same games, so that an arm's time is
compared with that of "voices" game by game.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from veca_marl.config import compose
from veca_marl.envs.core.game import Game

HERE = Path(__file__).parent
COLUMNS = (
    *("body", "agents", "arm", "episodes", "solved", "solved_low", "solved_high"),
    *("seconds", "seconds_interval", "longer", "longer_interval"),
)
NORMAL_95 = 1.96
Played = NDArray[np.float64]
ARMS = {
    "voices": [],
    "finder muted": ["task.muted=finder"],
    "no hearing": ["senses/audio=deaf"],
    "mono": ["senses/audio=mono"],
    "stereo": ["senses/audio=stereo"],
}
FOR_MORE = ("voices", "finder muted", "no hearing")  # arms for more than two agents
SECONDS = {"walker_voice": 20, "mitten_voice": 90, "full_voice": 90}  # by body; crawling is slow


def play_once(game: Game, seed: int) -> tuple[bool, float]:
    """Return whether all agents reached the object in time, and the duration in seconds."""
    rng = np.random.default_rng([2026, seed])
    game.reset(rng)
    while True:
        rows = {
            player.name: player.body.encode(game.expert_of(player).act(game.observe(player)))
            for player in game.players
        }
        outcome = game.step(rows)
        if outcome.done:
            return outcome.terminated, game.steps * game.world.clock.step_s


def play(body: str, agents: int, arm: str, episodes: int) -> Played:
    """Return for each episode whether it was solved, and its seconds: ``(episodes, 2)``."""
    # the experts use `is_visible`; vision and touch are switched off to save time
    shut = ["senses/vision=blind", "senses/touch=numb"]
    setting = [f"body={body}", f"task.agents={agents}", f"task.max_seconds={SECONDS[body]}"]
    game = Game(compose(["+task=MultiAgentNav", *setting, *shut, *ARMS[arm]]).game)
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


def row(body: str, agents: int, arm: str, played: Played, voices: Played) -> dict[str, object]:
    solved, seconds = float(played[:, 0].mean()), played[:, 1]
    longer = seconds - voices[:, 1]
    numbers = (solved, *wilson(solved, len(played)), *mean(seconds), *mean(longer))
    cells = (body, agents, arm, len(played), *(round(float(number), 3) for number in numbers))
    return dict(zip(COLUMNS, cells, strict=True))


def settings(asked: argparse.Namespace) -> Iterator[tuple[str, int, tuple[str, ...]]]:
    """Yield body, number of agents and arms."""
    for body in asked.bodies:
        for agents in asked.agents:
            walkers = body == "walker_voice"
            if walkers or agents == 2:
                yield body, agents, tuple(ARMS) if walkers and agents == 2 else FOR_MORE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", nargs="*", default=list(SECONDS), choices=list(SECONDS))
    parser.add_argument("--agents", type=int, nargs="*", default=[2, 3, 4])
    parser.add_argument("--episodes", type=int, default=30)
    asked = parser.parse_args()
    with (HERE / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for body, agents, arms in settings(asked):
            voices = play(body, agents, "voices", asked.episodes)
            for arm in arms:
                played = voices
                if arm != "voices":
                    played = play(body, agents, arm, asked.episodes)
                cells = row(body, agents, arm, played, voices)
                table.writerow(cells)
                file.flush()
                print(*cells.values(), sep="\t", flush=True)


if __name__ == "__main__":
    main()
