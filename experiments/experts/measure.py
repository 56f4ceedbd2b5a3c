"""Let the scripted expert and chance play every task; print the table and write results.csv.

python experiments/experts/measure.py                       # all tasks, ten episodes each
python experiments/experts/measure.py TurnBaby SitBaby --episodes 20 --body full
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np

import veca_marl
from veca_marl.config import compose
from veca_marl.envs.game import Game, Observation
from veca_marl.envs.game_cfg import GameCfg
from veca_marl.envs.task import Player

HERE = Path(__file__).parent
COLUMNS = ["task", "body", "player", "episodes", "return", "interval_95", "least", "greatest"]
STUDENT_95 = {5: 2.776, 10: 2.262, 20: 2.093}  # two-sided quantile of t by number of episodes

Choice = Callable[[Game, Player, Observation, np.random.Generator], np.ndarray]


def by_expert(game: Game, player: Player, seen: Observation, rng: np.random.Generator):
    return player.body.encode(game.task.expert(player, seen))


def by_chance(game: Game, player: Player, seen: Observation, rng: np.random.Generator):
    spec = player.body.action_spec
    return rng.uniform(spec.low, spec.high, spec.shape).astype(spec.dtype)


def play(cfg: GameCfg, choose: Choice, seed: int) -> float:
    """Return what the players are paid, on average, in one episode."""
    game, rng = Game(cfg), np.random.default_rng([2026, seed])
    game.reset(rng)
    paid, over = 0.0, False
    while not over:
        rows = {p.name: choose(game, p, game.observe(p), rng) for p in game.players}
        outcome = game.step(rows, rng)
        paid += float(np.mean([game.pay(terms) for terms in outcome.terms.values()]))
        over = outcome.done
    game.close()
    return paid


def measure(task: str, body: str, episodes: int) -> list[dict[str, object]]:
    # experts of joint-level tasks use privileged state: their eyes are shut to save time
    own = [] if task == "KickTheBall" else ["senses/vision=blind"]
    chosen = [] if body == "own" else [f"body={body}"]
    cfg = compose([f"+task={task}", *own, *chosen]).game
    rows: list[dict[str, object]] = []
    for name, choose in (("expert", by_expert), ("random", by_chance)):
        paid = np.array([play(cfg, choose, seed) for seed in range(episodes)])
        interval = STUDENT_95[episodes] * paid.std(ddof=1) / np.sqrt(episodes)
        numbers = (paid.mean(), interval, paid.min(), paid.max())
        values = (task, body, name, episodes, *(round(float(number), 3) for number in numbers))
        rows.append(dict(zip(COLUMNS, values, strict=True)))
        print(*values)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=veca_marl.list_tasks())
    parser.add_argument("--body", default="own", help="a preset; the task's own if not said")
    parser.add_argument("--episodes", type=int, default=10, choices=sorted(STUDENT_95))
    asked = parser.parse_args()
    rows = [row for task in asked.tasks for row in measure(task, asked.body, asked.episodes)]
    path = HERE / ("results.csv" if asked.body == "own" else f"results_{asked.body}.csv")
    with path.open("w", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
