"""Let the expert and the random policy play every task; print the table and write results.csv.

python experiments/experts/measure.py                       # all tasks, ten episodes each
python experiments/experts/measure.py TurnBaby SitBaby --episodes 20 --body full
python experiments/experts/measure.py SoccerTwoPlayer --body full --seconds 60

In games of two teams the expert plays against the random policy and against itself, and the random
policy against itself. Rows of tasks that are not measured stay in the table.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import numpy as np

import veca_marl
from veca_marl.config import compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg, Script

HERE = Path(__file__).parent
COLUMNS = [
    *("task", "body", "seconds", "player", "opponent"),
    *("episodes", "return", "interval_95", "least", "greatest", "ended", "solved"),
]
STUDENT_95 = {5: 2.776, 10: 2.262, 20: 2.093, 40: 2.023}  # two-sided quantile of t by episodes
ALONE = ((Script.expert, None), (Script.random, None))
AGAINST = (
    (Script.expert, Script.random),
    (Script.expert, Script.expert),
    (Script.random, Script.random),
)


def play(
    cfg: GameCfg, first: Script, others: Script | None, seed: int
) -> tuple[float, bool, float]:
    """Return the return of the first team in one episode, and how the episode ended.

    Returns:
        The return, whether the rules ended the episode, and the share of the team's players for
        which the goal was reached after the last step (NaN in a task without a goal).
    """
    game, rng = Game(cfg), np.random.default_rng([2026, seed])
    game.reset(rng)
    ours = game.team(cfg.teams[0].name)
    total, over = 0.0, False
    while not over:
        for player in game.players:
            script = first if player in ours or others is None else others
            game.play_script(player, script)
        outcome = game.advance()
        total += float(np.mean([game.reward_of(outcome.terms[player.name]) for player in ours]))
        over = outcome.done
    game.close()
    solved = [outcome.solved.get(player.name, math.nan) for player in ours]
    return total, outcome.terminated, float(np.mean(solved))


def measure(task: str, body: str, seconds: float | None, episodes: int) -> list[dict[str, object]]:
    # the other experts use privileged state; vision and touch are switched off to save time
    own = [] if task == "KickTheBall" else ["senses/vision=blind", "senses/touch=numb"]
    chosen = [] if body == "own" else [f"body={body}"]
    time = [] if seconds is None else [f"task.max_seconds={seconds}"]
    cfg = compose([f"+task={task}", *own, *chosen, *time]).game
    rows: list[dict[str, object]] = []
    for first, others in ALONE if len(cfg.teams) == 1 else AGAINST:
        played = [play(cfg, first, others, seed) for seed in range(episodes)]
        total, ended, solved = (np.array(column, float) for column in zip(*played, strict=True))
        interval = STUDENT_95[episodes] * total.std(ddof=1) / np.sqrt(episodes)
        ends = (ended.mean(), solved.mean())
        numbers = (total.mean(), interval, total.min(), total.max(), *ends)
        rounded = ["" if math.isnan(number) else round(float(number), 3) for number in numbers]
        names = (task, body, cfg.task.max_seconds, first.value, others.value if others else "")
        values = (*names, episodes, *rounded)
        rows.append(dict(zip(COLUMNS, values, strict=True)))
        print(*values)
    return rows


def write(path: Path, rows: list[dict[str, object]]) -> None:
    """Write rows into a table, and keep its rows of other tasks."""
    asked, kept = {row["task"] for row in rows}, []
    if path.exists():
        with path.open(newline="") as table:
            kept = [row for row in csv.DictReader(table) if row["task"] not in asked]
    with path.open("w", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted([*kept, *rows], key=lambda row: str(row["task"])))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=veca_marl.list_tasks())
    parser.add_argument("--body", default="own", help="a preset; by default that of the task")
    parser.add_argument(
        "--seconds", type=float, help="duration of an episode; by default that of the task"
    )
    parser.add_argument("--episodes", type=int, default=10, choices=sorted(STUDENT_95))
    asked = parser.parse_args()
    rows = [
        row
        for task in asked.tasks
        for row in measure(task, asked.body, asked.seconds, asked.episodes)
    ]
    write(HERE / ("results.csv" if asked.body == "own" else f"results_{asked.body}.csv"), rows)


if __name__ == "__main__":
    main()
