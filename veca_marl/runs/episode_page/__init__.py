"""An episode as one HTML page that opens from disk: 3D, eyes, skin, sound, rewards, actions."""

from veca_marl.runs.episode_page.episode import Agent, Episode, Geometry, SceneInfo
from veca_marl.runs.episode_page.page import read_page, write_page
from veca_marl.runs.episode_page.recorder import EpisodeRecorder, play

__all__ = [
    "Agent",
    "Episode",
    "EpisodeRecorder",
    "Geometry",
    "SceneInfo",
    "play",
    "read_page",
    "write_page",
]
