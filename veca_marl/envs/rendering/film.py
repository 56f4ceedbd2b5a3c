"""Pictures of a game for people: views by cameras, and panels of what an agent senses."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.core.task import Player
from veca_marl.envs.rendering.cameras import CameraKind, CameraOperator
from veca_marl.envs.rendering.panels import (
    BACKGROUND,
    LINE_HEIGHT,
    Image,
    TermBar,
    blank,
    eye_panels,
    reward_bars,
    skin_panel,
    spectrograms,
    text_panel,
    titled,
)
from veca_marl.envs.rendering.photograph import Quality, photograph
from veca_marl.registry import unknown
from veca_marl.sim.hearing import AudioSense
from veca_marl.sim.vision import Camera

ALL = "all"
Kind = TypeVar("Kind", bound=Enum)
_ROWS = 720  # of the picture in which text has its own size
_HIGHEST_SPECTRA = 0.7  # of their width
_NARROWEST, _WIDEST = 0.22, 0.36  # of the panels, as fractions of the picture


class FilmQuality(Enum):
    """Shadows and edges of the pictures, and so what they cost.

    Attributes:
        auto: `fast` in a window, which has to keep its speed, otherwise `best`.
        fast: Contact shadows only, as the agents' eyes see them.
        good: Soft shadows.
        best: Soft shadows, and smooth edges from four times as many pixels.
    """

    auto = "auto"
    fast = "fast"
    good = "good"
    best = "best"


_COSTS = {
    FilmQuality.fast: Quality(soft_shadows=False, supersampling=1),
    FilmQuality.good: Quality(supersampling=1, map_px=1024),
    FilmQuality.best: Quality(),
    FilmQuality.auto: Quality(),
}


@dataclass
class FilmCfg:
    """How a game is shown to people.

    Attributes:
        camera: What the camera does, see `CameraKind`; in Python also by its name.
        agent: Name of the agent that is shown; its senses are in the panels. `all` shows all agents
            in one view, or each in a view of its own if the playground has several rooms; empty is
            `all` in a game of several agents.
        width: Width of the picture in pixels, even.
        height: Height, even.
        panels: Whether there are panels beside the view: of the senses that the agent has, of the
            reward and of the text.
        quality: Shadows and edges, see `FilmQuality`; in Python also by its name.

    Raises:
        ValueError: If a number is outside of its range.
    """

    camera: CameraKind = CameraKind.auto
    agent: str = ""
    width: int = 1280
    height: int = 720
    panels: bool = True
    quality: FilmQuality = FilmQuality.auto

    def __post_init__(self) -> None:
        self.camera = _kind("camera", self.camera, CameraKind)
        self.quality = _kind("quality", self.quality, FilmQuality)
        for name, pixels in (("width", self.width), ("height", self.height)):
            if not 64 <= pixels <= 7680 or pixels % 2:
                raise ValueError(f"{name}={pixels} must be an even number from 64 to 7680")


def _kind(key: str, chosen: object, kinds: type[Kind]) -> Kind:
    """Return a choice that may be given by its name, as on the command line."""
    names = [kind.name for kind in kinds]
    if isinstance(chosen, kinds):
        return chosen
    if isinstance(chosen, str) and chosen in names:
        return kinds[chosen]
    raise ValueError(f"{key}={chosen!r}; choices: {', '.join(names)}")


class Film:
    """Renders pictures of a game, moment by moment; it never changes the game.

    Args:
        game: The game to show.
        cfg: How.

    Raises:
        ValueError: If there is no such agent; the message lists those there are.
    """

    def __init__(self, game: Game, cfg: FilmCfg) -> None:
        self._game, self._cfg = game, cfg
        self._groups = shown_agents(game, cfg.agent)
        self._operators: dict[tuple[tuple[str, ...], float], CameraOperator] = {}
        self._spectra: deque[NDArray[Any]] = deque(maxlen=game.cfg.clock.control_rate_hz)
        self._heard_step = -1

    @property
    def player(self) -> Player:
        """The agent whose senses are in the panels."""
        return _player(self._game, self._groups[0][0])

    def listen(self, observation: Mapping[str, NDArray[Any]]) -> None:
        """Take note of what the agent hears; call it for moments that are not rendered.

        Args:
            observation: Its observation.
        """
        if self._game.steps < self._heard_step:
            self._spectra.clear()
        ears = self.player.senses.get("audio")
        if isinstance(ears, AudioSense) and self._heard_step != self._game.steps:
            self._spectra.append(ears.log_magnitudes(observation["audio"]))
        self._heard_step = self._game.steps

    def picture(
        self,
        observation: Observation | None = None,
        bars: Sequence[TermBar] = (),
        lines: Sequence[str] = (),
    ) -> Image:
        """Return the picture of this moment, ``(height, width, 3)`` uint8.

        Args:
            observation: What the agent of the panels observes; None reads it from the game.
            bars: The terms of its reward.
            lines: Text below them.
        """
        cfg = self._cfg
        if not cfg.panels:
            return self._views(cfg.width)
        seen = self._game.observe(self.player) if observation is None else observation
        self.listen(seen)
        column = self._column(seen, bars, lines)
        views = self._views(cfg.width - column.shape[1])
        return np.concatenate([views, column], axis=1)

    def _views(self, width: int) -> Image:
        """Return the views of all cameras side by side, or in several rows."""
        count, height = len(self._groups), self._cfg.height
        columns = min(
            range(1, count + 1),
            key=lambda n: abs(np.log((width / n) / (height / -(-count // n)) / 1.4)),
        )
        rows = -(-count // columns)
        image = blank(height, width)
        for number, group in enumerate(self._groups):
            row, column = divmod(number, columns)
            top, base = height * row // rows, height * (row + 1) // rows
            left, right = width * column // columns, width * (column + 1) // columns
            image[top:base, left:right] = self._view(group, right - left, base - top)
        image[:, [width * n // columns for n in range(1, columns)]] = BACKGROUND
        image[[height * n // rows for n in range(1, rows)]] = BACKGROUND
        return image

    def _view(self, group: tuple[str, ...], width: int, height: int) -> Image:
        key = group, width / height
        if key not in self._operators:
            kind = self._cfg.camera
            self._operators[key] = CameraOperator(self._game, kind, group, width / height)
        shot = self._operators[key].shot()
        camera = Camera(width, height, shot.fov_deg)
        scene = self._game.world.scene
        image = photograph(scene, camera, shot.pose, _COSTS[self._cfg.quality], shot.hidden)
        return titled(image, group[0], self._scale) if len(self._groups) > 1 else image

    @property
    def _scale(self) -> float:
        return self._cfg.height / _ROWS

    def _column(self, seen: Observation, bars: Sequence[TermBar], lines: Sequence[str]) -> Image:
        """Return the panels one below the other; a sense that the agent lacks takes no room."""
        cfg, scale = self._cfg, self._scale
        line = LINE_HEIGHT * scale
        text = line * (len(lines) + 0.5) if lines else 0.0
        terms = line * (len(bars) + 1.8) if bars else 0.0
        heights = self._relative_heights(seen)
        room = (cfg.height - text - terms) / max(sum(heights.values()), 0.01)
        width = round(min(max(room, _NARROWEST * cfg.width), _WIDEST * cfg.width) / 2.0) * 2
        if "audio" in heights:  # spectra are read at any height: they take what is left
            left = cfg.height - text - terms - sum(heights.values()) * width
            heights["audio"] += min(max(left / width, 0.0), _HIGHEST_SPECTRA - heights["audio"])
        column = blank(cfg.height, width)
        panels = self._sense_panels(seen, heights, width)
        if bars:
            panels.append(reward_bars(bars, round(terms), width, scale))
        if lines:
            panels.append(text_panel(lines, round(text), width, scale))
        top = 0
        for panel in panels:
            end = min(top + panel.shape[0], cfg.height)
            column[top:end, : panel.shape[1]] = panel[: end - top]
            top = end
        return column

    def _relative_heights(self, seen: Observation) -> dict[str, float]:
        """Return the heights of the panels of senses, as fractions of their width."""
        heights = {}
        if "vision" in seen:
            heights["vision"] = 0.5 * seen["vision"].shape[-2] / seen["vision"].shape[-1]
        if self._spectra:
            heights["audio"] = 0.2
        if "touch" in seen or "touch_parts" in seen:
            heights["touch"] = 0.75
        return heights

    def _sense_panels(
        self, seen: Observation, heights: Mapping[str, float], width: int
    ) -> list[Image]:
        scale, half = self._scale, width // 2
        panels = [np.concatenate(eye_panels(seen, half, scale), axis=1)] if "vision" in seen else []
        if "audio" in heights:
            spectra, columns = list(self._spectra), self._spectra.maxlen or 1
            height = round(heights["audio"] * width)
            ears = spectrograms(spectra, columns, height, half, scale)
            panels.append(np.concatenate(ears, axis=1))
        scene = self._game.world.scene
        body = scene.objects[self.player.body.object_id]
        skin = skin_panel(scene, body, seen, round(heights.get("touch", 0.75) * width), scale)
        if skin is not None:
            panels.append(_cut(skin, width))
        return panels


def _cut(panel: Image, width: int) -> Image:
    """Return a panel without the columns that do not fit."""
    return panel[:, :width]


def shown_agents(game: Game, agent: str) -> list[tuple[str, ...]]:
    """Return the names of the agents in each view.

    Args:
        game: The game.
        agent: See `FilmCfg`.

    Raises:
        ValueError: If there is no such agent; the message lists those there are.
    """
    # the first actor comes first: its senses are shown
    first = game.actors[0].name if game.actors else game.players[0].name
    names = sorted((player.name for player in game.players), key=lambda name: name != first)
    if agent not in ("", ALL, *names):
        raise ValueError(unknown("agent", agent, [ALL, *names]))
    if agent in names:
        return [(agent,)]
    if len(game.cfg.playground.rooms) > 1:
        return [(name,) for name in names]
    return [tuple(names)]


def _player(game: Game, name: str) -> Player:
    """Return a player: a game makes new ones when a simulation breaks down."""
    return next(player for player in game.players if player.name == name)
