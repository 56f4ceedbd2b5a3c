"""Write what can be derived: one page per task from its docstring, and the pictures.

Run it with ``make docs``; the results are committed, so that they can be read without running it.
"""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from veca_marl.api import make
from veca_marl.envs.task import TASKS, Task

mpl.use("Agg")
import matplotlib.pyplot as plt

DOCS = Path(__file__).resolve().parent.parent / "docs"
BIN_HZ = 22050 / 1024


def task_page(task: type[Task]) -> str:
    """Return the Markdown page of a task."""
    cfg_type = task.cfg_type()
    teams = ", ".join(f"`{team.name}` ({team.size})" for team in task.teams_of(cfg_type()))
    lines = [
        f"# {task.__name__}",
        "",
        "<!-- written by scripts/make_docs.py from the docstring: edit there -->",
        "",
        inspect.cleandoc(task.__doc__ or "").replace("Terms:\n", "## Reward terms\n\n"),
        "",
        f"Teams: {teams}. Senses: {', '.join(task.senses)}.",
        "",
        f"The expert: {inspect.cleandoc(task.expert.__doc__ or '')}",
        "",
        "## Numbers",
        "",
        "| `task.` | default |",
        "|---|---|",
        *(f"| `{field.name}` | `{default(field)}` |" for field in dataclasses.fields(cfg_type)),
        "",
        inspect.cleandoc(cfg_type.__doc__ or ""),
        "",
        "```",
        f"python -m veca_marl.train +task={task.__name__}",
        "```",
        "",
    ]
    return "\n".join(lines)


def default(field: dataclasses.Field[Any]) -> Any:
    """Return what a configuration field is when nothing is said."""
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def perception_picture(path: Path) -> None:
    """Draw what an agent sees and hears at one moment of KickTheBall."""
    env = make("KickTheBall", seed=3)
    game = env.games[0]
    player = game.players[0]
    rng = np.random.default_rng(3)
    game.reset(rng)
    # the ball ahead, to the left, in view of both eyes
    player.body.place((0.6, -0.2, 0.0), yaw_rad=1.95)
    game.task.ball.place((-0.35, 0.95, 0.15), velocity=(0.1, -0.1, 0.0))
    observation = game.observe(player)
    for _ in range(6):
        game.step({player.name: np.zeros(2, np.float32)}, rng)
        observation = game.observe(player)
    draw_perception(env.spectator.frame(observation), observation["audio"], path)
    env.close()


def draw_perception(frame: np.ndarray, audio: np.ndarray, path: Path) -> None:
    """Lay eyes and room over the spectra of both ears."""
    figure, (seen, heard) = plt.subplots(
        2, 1, figsize=(9, 5.4), height_ratios=(2, 1.1), constrained_layout=True
    )
    seen.imshow(frame)
    seen.set_title("left eye, right eye, and the room from above", fontsize=10)
    seen.axis("off")
    frequency_khz = np.arange(audio.shape[1]) * BIN_HZ / 1000
    heard.plot(frequency_khz, audio[0], label="left ear", lw=1)
    heard.plot(frequency_khz, audio[1], label="right ear", lw=1)
    heard.set(xlabel="frequency in kHz", ylabel="log10 |spectrum|", xlim=(0, frequency_khz[-1]))
    heard.legend(frameon=False, ncols=2, loc="upper right")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Write all pages and pictures."""
    (DOCS / "tasks").mkdir(parents=True, exist_ok=True)
    (DOCS / "images").mkdir(parents=True, exist_ok=True)
    for name, task in TASKS.items():
        (DOCS / "tasks" / f"{name}.md").write_text(task_page(task), encoding="utf-8")
    perception_picture(DOCS / "images" / "perception.png")


if __name__ == "__main__":
    main()
