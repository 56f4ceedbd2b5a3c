"""Write what can be derived: a page per task from its docstring, tables of the body, the pictures.

Run it with ``make pages``; the results are committed, so that they can be read without running it.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from enum import Enum
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from veca_marl.api import make
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import find_expert, has_expert
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS, Task
from veca_marl.envs.rendering.touch_picture import picture_of_touch
from veca_marl.sim.body.anatomy.skeleton import limit_sources, load_skeleton
from veca_marl.sim.body.proprioception import ProprioceptionQuality, kept_parts, part_slices
from veca_marl.sim.touch.taxels import TAXELS_PER_TRIANGLE, taxels_of
from veca_marl.sim.vision.optics import Camera, look_at

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
        expert_text(task.__name__),
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


def expert_text(task: str) -> str:
    """Return what the page of a task says about its expert."""
    if not has_expert(task):
        return "The task has no scripted expert."
    return f"The expert: {inspect.cleandoc(find_expert(task).__doc__ or '')}"


def default(field: dataclasses.Field[Any]) -> Any:
    """Return what a configuration field is when nothing is said."""
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default.value if isinstance(field.default, Enum) else field.default


def body_page(page: str) -> str:
    """Return the page about the body with its tables as the data have them."""
    tables = {"proprioception": proprioception_table, "bones": bone_table, "joints": joint_table}
    for name, table in tables.items():
        region = re.compile(f"(?<=<!-- {name} -->\n).*(?=<!-- /{name} -->)", re.DOTALL)
        page = region.sub("\n".join(["", *table(), "", ""]), page)
    return page


def proprioception_table() -> list[str]:
    """Return where each part of proprioception is in its vector, and which qualities have it."""
    skeleton = load_skeleton()
    units = {
        "bone_orientations": "two unit vectors for each bone",
        "joint_angles": "rad",
        "joint_velocities": "rad/s",
        "joint_torques": "share of the joint's strength, [-1, 1]",
        "head_acceleration": "m/s²",
        "head_turning": "rad/s",
    }
    lines = ["| rows | part | unit | qualities that have it |", "|---|---|---|---|"]
    for part, rows in part_slices(len(skeleton.bones), len(skeleton.joints)).items():
        having = [f"`{q.name}`" for q in ProprioceptionQuality if part in kept_parts(q)]
        place = f"{rows.start} to {rows.stop - 1}"
        lines.append(f"| {place} | `{part}` | {units[part]} | {', '.join(having)} |")
    return lines


def bone_table() -> list[str]:
    """Return the bones, left and right in one line."""
    skeleton = load_skeleton()
    index = {bone.name: i for i, bone in enumerate(skeleton.bones)}
    lines = [
        "| `body.bone_names` | index | parent | mass | skin | taxels |",
        "|---|---|---|---|---|---|",
    ]
    for bone in skeleton.bones:
        if bone.name.startswith("r_"):
            continue
        sides = both_sides(bone.name)
        parent = skeleton.bones[bone.parent].name if bone.parent >= 0 else ""
        slices = [taxels_of(side) for side in sides]
        skin = f"{1000 * bone.skin_thickness_m:g} mm, {bone.skin_force_n:g} N"
        lines.append(
            f"| `{bone.name}` | {' / '.join(str(index[side]) for side in sides)} | {parent} "
            f"| {1000 * bone.mass_kg:g} g | {skin} "
            f"| {' / '.join(f'{s.start}:{s.stop}' for s in slices)} |"
        )
    return lines


def joint_table() -> list[str]:
    """Return the joints, left and right in one line."""
    joints = load_skeleton().joints
    names = [f"{joint.bone}.{joint.label}" for joint in joints]
    lines = [
        "| `body.joint_names` | index | range | torque | range from |",
        "|---|---|---|---|---|",
    ]
    for name, joint, sources in zip(names, joints, limit_sources(), strict=True):
        if name.startswith("r_"):
            continue
        where = " / ".join(str(names.index(side)) for side in both_sides(name))
        low, high = np.degrees([joint.low_rad, joint.high_rad])
        source = " / ".join(dict.fromkeys(sources))
        lines.append(
            f"| `{name}` | {where} | {low:.0f}° to {high:.0f}° "
            f"| {joint.torque_nm:.3g} N m | {source} |"
        )
    return lines


def both_sides(name: str) -> list[str]:
    """Return the names on the left and on the right, or the one of the middle."""
    return [name, f"r_{name[2:]}"] if name.startswith("l_") else [name]


def begun(task: str, seed: int) -> tuple[VecaEnv, Game]:
    """Return an environment and its only game at the start of an episode."""
    env = make(task, seed=seed)
    env.games[0].reset(np.random.default_rng(seed))
    return env, env.games[0]


def perception_picture(path: Path) -> None:
    """Draw what an agent sees and hears at one moment of KickTheBall."""
    env, game = begun("KickTheBall", seed=3)
    player = game.players[0]
    # the ball ahead, to the left, in view of both eyes
    player.body.place((0.6, -0.2, 0.0), yaw_rad=1.95)
    game.task.ball.place((-0.35, 0.95, 0.15), velocity=(0.1, -0.1, 0.0))
    observation = game.observe(player)
    for _ in range(6):
        game.step({player.name: np.zeros(2, np.float32)})
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


def feeling_picture(path: Path) -> None:
    """Draw a child that lies on its back, and what its skin feels of the floor and of itself."""
    env, game = begun("TurnBaby", seed=2)
    player = game.players[0]
    for _ in range(50):
        player.body.rest()
        game.advance()
    scene, middle = game.world.scene, player.body.position
    camera = Camera(480, 360, fov_deg=34.0)
    beside = look_at(middle + np.array([0.8, 0.9, 0.7]), middle)
    readings = game.observe(player)["touch"].reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
    skin = picture_of_touch(scene, scene.objects[player.body.object_id], readings, 360)
    picture = np.concatenate([camera.render(scene, [beside]).rgb[0], skin], axis=1)
    plt.imsave(path, picture)
    env.close()


def main() -> None:
    """Write all pages and pictures."""
    (DOCS / "tasks").mkdir(parents=True, exist_ok=True)
    (DOCS / "images").mkdir(parents=True, exist_ok=True)
    for name, task in TASKS.items():
        (DOCS / "tasks" / f"{name}.md").write_text(task_page(task), encoding="utf-8")
    body = DOCS / "reference" / "body.md"
    body.write_text(body_page(body.read_text(encoding="utf-8")), encoding="utf-8")
    perception_picture(DOCS / "images" / "perception.png")
    feeling_picture(DOCS / "images" / "touch.png")


if __name__ == "__main__":
    main()
