"""The pictures of the pages: perception, touch, and one picture per task."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from tools.docs_pages.parts_picture import parts_picture
from tools.docs_pages.task_pages import built_in_tasks
from tools.docs_pages.viewpoints import FOV_DEG, viewpoint
from veca_marl.api import make
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.game import Game
from veca_marl.envs.rendering import CameraKind, Quality, photograph, touch_image
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.touch import TAXELS_PER_TRIANGLE
from veca_marl.sim.vision import Camera, look_at

mpl.use("Agg")
import matplotlib.pyplot as plt

BIN_HZ = 22050 / 1024


class Moment(NamedTuple):
    """The moment that a task's picture shows.

    Attributes:
        seed: Seed of the episode.
        expert_steps: Steps of the expert before the picture.
    """

    seed: int = 1
    expert_steps: int = 0


# of tasks with the same start as another one, and of those where all things are near in an episode
_MOMENTS = {
    "BabyzumasRevenge": Moment(seed=6),
    "HandRegard": Moment(expert_steps=60),
    "ObjectNav": Moment(seed=6),
    "ObjectPhysNav": Moment(seed=6),
    "SelfTouch": Moment(expert_steps=60),
}


def write_pictures(folder: Path) -> None:
    """Write all pictures into a folder."""
    (folder / "tasks").mkdir(parents=True, exist_ok=True)
    perception_picture(folder / "perception.png")
    touch_picture(folder / "touch.png")
    parts_picture(folder / "skin_parts.png")
    for name in built_in_tasks():
        task_picture(name, folder / "tasks" / f"{name}.png")


def started(task: str, seed: int) -> tuple[VecaEnv, Game]:
    """Return an environment and its only game at the start of an episode."""
    env = make(task, seed=seed)
    env.games[0].reset(np.random.default_rng(seed))
    return env, env.games[0]


def task_picture(task: str, path: Path) -> None:
    """Draw one moment of an episode: the first second of most tasks."""
    moment = _MOMENTS.get(task, Moment())
    env, game = started(task, moment.seed)
    if moment.expert_steps:
        env.rollout(moment.expert_steps, policy=ExpertPolicy(env))
    elif isinstance(game.players[0].body, Walker):
        for _ in range(25):  # one second, in which the ball of KickTheBall appears
            for player in game.players:
                player.body.rest()
            game.advance()
    camera = Camera(640, 400, fov_deg=FOV_DEG)
    image = photograph(game.world.scene, camera, look_at(*viewpoint(game)), Quality())
    plt.imsave(path, image, pil_kwargs={"optimize": True})
    env.close()


def perception_picture(path: Path) -> None:
    """Draw the observation of one agent at one moment of KickTheBall."""
    env, game = started("KickTheBall", seed=3)
    player = game.players[0]
    # the ball ahead, to the left, in view of both eyes
    player.body.place((0.6, -0.2, 0.0), yaw_rad=1.95)
    game.world.props["ball"].place((-0.35, 0.95, 0.15), velocity=(0.1, -0.1, 0.0))
    observation = game.observe(player)
    for _ in range(6):
        game.step({player.name: np.zeros(2, np.float32)})
        observation = game.observe(player)
    magnitudes = observation["audio"][:2]
    eyes = [np.moveaxis(eye, 0, -1) for eye in observation["vision"]]
    view = env.render(camera=CameraKind.follow, width=560, height=420, panels=False)
    enlarged = [np.kron(eye, np.ones((5, 5, 1), np.uint8)) for eye in eyes]
    draw_perception(np.concatenate([*enlarged, view], axis=1), magnitudes, path)
    env.close()


def draw_perception(frame: NDArray[np.uint8], audio: NDArray[np.float32], path: Path) -> None:
    """Lay eyes and room over the spectra of both ears."""
    figure, (seen, heard) = plt.subplots(
        2, 1, figsize=(9, 5.4), height_ratios=(2, 1.1), constrained_layout=True
    )
    seen.imshow(frame)
    seen.set_title("left eye, right eye, and the agent from behind", fontsize=10)
    seen.axis("off")
    frequency_khz = np.arange(audio.shape[1]) * BIN_HZ / 1000
    heard.plot(frequency_khz, audio[0], label="left ear", lw=1)
    heard.plot(frequency_khz, audio[1], label="right ear", lw=1)
    heard.set(xlabel="frequency in kHz", ylabel="log10 |spectrum|", xlim=(0, frequency_khz[-1]))
    heard.legend(frameon=False, ncols=2, loc="upper right")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def touch_picture(path: Path) -> None:
    """Draw a child that lies on its back beside the readings of its taxels."""
    env, game = started("TurnBaby", seed=2)
    player = game.players[0]
    for _ in range(50):
        player.body.rest()
        game.advance()
    scene, middle = game.world.scene, player.body.position
    camera = Camera(480, 360, fov_deg=34.0)
    beside = look_at(middle + np.array([0.8, 0.9, 0.7]), middle)
    photo = photograph(scene, camera, beside, Quality())
    readings = game.observe(player)["touch"].reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
    skin = touch_image(scene, scene.objects[player.body.object_id], readings, 360)
    picture = np.concatenate([photo, skin], axis=1)
    plt.imsave(path, picture)
    env.close()
