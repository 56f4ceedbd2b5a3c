"""Film the expert of every task: clips of the gallery, and the moving picture of the README.

``python -m tools.make_films`` writes ``docs/_static/films/<task>.webm``, ``docs/images/film.webp``
and the page ``docs/tasks/gallery.md``; the results are committed. Names of tasks film these only;
``--page`` writes the page alone. Needs the extra ``[plot]`` (Pillow).
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from tools.docs_pages.gallery_page import gallery_page
from tools.docs_pages.task_pages import sorted_by_suite
from veca_marl.algos.evaluation.evaluate import Exploration
from veca_marl.envs.rendering import CameraKind, Film, FilmCfg, FilmQuality
from veca_marl.play.screen import Screen
from veca_marl.play.session import EXPERT, Moment, Session, choose

DOCS = Path(__file__).resolve().parent.parent / "docs"
LARGEST_BYTES, ALL_BYTES = 1_500_000, 25_000_000
SHORTEST_S, LONGEST_S = 6.0, 10.0
WIDTH, HEIGHT = 640, 360
_OVERSIZED = 1.5  # of what is rendered: smooth edges at half the cost of twice the size
Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Clip:
    """What a clip shows.

    Attributes:
        episode: Number of the episode, as `play` counts with its default seed.
        seconds: Length; the clip is that part of the episode in which the expert achieves most.
        camera: What the camera does.
        overrides: Changes of the task.
    """

    episode: int = 0
    seconds: float = 6.4
    camera: CameraKind = CameraKind.auto
    overrides: tuple[str, ...] = ()


CLIPS = {
    "MazeNav": Clip(camera=CameraKind.above),
    "ObjectPhysNav": Clip(camera=CameraKind.room),
    "SoccerOnePlayer": Clip(camera=CameraKind.room),
}
"""Clips that differ from the others."""

HERO_TASK, HERO = "KickTheBall", Clip(seconds=7.0)
_HERO_SIZE, _HERO_KEEP = (800, 450), 2  # of its pictures, every second one


def film(task: str, clip: Clip, path: Path) -> None:
    """Write the clip of a task as a WebM file (VP9)."""
    width, height = round(_OVERSIZED * WIDTH), round(_OVERSIZED * HEIGHT)
    cfg = FilmCfg(clip.camera, "", width, height, panels=False, quality=FilmQuality.good)
    session = _session(task, clip)
    view = Film(session.game, cfg)
    pictures: list[Image] = []
    while len(pictures) < SHORTEST_S * session.steps_per_s:  # episodes of some tasks are short
        moments = _moments_of(session, clip, view.picture)
        pictures += [_reduced(view.picture()) for _ in moments]
        clip = replace(clip, episode=clip.episode + 1)
    _write_webm(path, pictures[: round(LONGEST_S * session.steps_per_s)], session.steps_per_s)
    session.close()


def _reduced(picture: Image) -> Image:
    return np.asarray(cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def hero(path: Path) -> None:
    """Write the film of the README, with panels, as an animated WebP file."""
    session = _session(HERO_TASK, HERO)
    screen = Screen(session, FilmCfg(width=_HERO_SIZE[0], height=_HERO_SIZE[1]))
    pictures = []
    for number, moment in enumerate(_moments_of(session, HERO, None)):
        screen.add(moment)
        if number % _HERO_KEEP == 0:
            pictures.append(screen.draw(moment, ()))
    frames = [Picture.fromarray(picture) for picture in pictures]
    step_ms = round(1000.0 * _HERO_KEEP / session.steps_per_s)
    options: dict[str, Any] = {"quality": 62, "method": 4}
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=step_ms, loop=0, **options
    )
    session.close()


def _session(task: str, clip: Clip) -> Session:
    choice = choose(EXPERT, [f"+task={task}", *clip.overrides])
    return Session(choice.cfg.game, choice.make_policy, 1, Exploration.deterministic)


def _moments_of(session: Session, clip: Clip, look: Callable[[], Image] | None) -> Iterator[Moment]:
    """Yield the moments of a clip.

    Args:
        session: What is played.
        clip: The clip.
        look: Called before the first one, so that the camera follows already.
    """
    played = list(_play(session, clip.episode))
    gains = np.cumsum([sum(moment.terms.values()) for moment in played])
    length = min(round(clip.seconds * session.steps_per_s), len(played))
    solved = next((n for n, moment in enumerate(played) if moment.solved), None)
    if solved is None:
        over = gains[length - 1 :] - np.concatenate(([0.0], gains))[: len(gains) - length + 1]
        first = int(over.argmax())
    else:  # until a second after the goal
        end = min(solved + session.steps_per_s, len(played))
        first = max(end - length, 0)
    for number, moment in enumerate(_play(session, clip.episode)):
        if look is not None and first - 10 <= number < first:
            look()
        if first <= number < first + length:
            yield moment
        if number >= first + length:
            return


def _play(session: Session, episode: int) -> Iterator[Moment]:
    moment = session.begin(episode)
    while not moment.done:
        moment = session.step()
        yield moment


def _write_webm(path: Path, pictures: list[Image], fps: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part")
    options = {"crf": "33", "b": "0", "deadline": "good", "cpu-used": "2"}
    with av.open(str(unfinished), "w", format="webm") as container:
        stream = container.add_stream("libvpx-vp9", rate=fps, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.bit_rate = 0
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    os.replace(unfinished, path)


def main() -> None:
    """Write the clips, the film of the README and the page.

    Raises:
        ValueError: If a file is larger than it may be.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", help="tasks to film; README for its film; default: all")
    parser.add_argument("--page", action="store_true", help="write the page alone")
    chosen = parser.parse_args()
    folder, tasks = DOCS / "_static" / "films", sorted_by_suite()
    wanted = [] if chosen.page else chosen.tasks or ["README", *tasks]
    for task in wanted:
        begun = time.process_time()
        path = DOCS / "images" / "film.webp" if task == "README" else folder / f"{task}.webm"
        if task == "README":
            hero(path)
        else:
            film(task, CLIPS.get(task, Clip()), path)
        size = path.stat().st_size
        print(f"{task}: {size} bytes, {time.process_time() - begun:.0f} s of processor time")
        if size > LARGEST_BYTES:
            raise ValueError(f"{path} has {size} bytes, more than {LARGEST_BYTES}")
    total = sum(path.stat().st_size for path in folder.glob("*.webm"))
    if total > ALL_BYTES:
        raise ValueError(f"{folder} has {total} bytes, more than {ALL_BYTES}")
    (DOCS / "tasks" / "gallery.md").write_text(gallery_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
