"""Episodes recorded for pages, with what the game was at each step."""

from contextlib import closing
from dataclasses import dataclass, field

import torch
from composed import compose
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.algos.evaluation.evaluate import random_policy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.runs.episode_page import Episode, EpisodeRecorder, play

RATE_HZ = 22_050


@dataclass
class Recorded:
    """An episode, and copies of the scene and the observations at each step."""

    episode: Episode = None
    positions: list = field(default_factory=list)
    rotations: list = field(default_factory=list)
    vertices: list = field(default_factory=list)
    colours: list = field(default_factory=list)
    observations: list = field(default_factory=list)
    played: list = field(default_factory=list)
    weights: dict = field(default_factory=dict)

    def copy(self, game) -> None:
        scene = game.world.scene
        self.positions.append(scene.positions.copy())
        self.rotations.append(scene.rotations.copy())
        self.vertices.append(scene.meshes.vertices.copy())
        self.colours.append(scene.surfaces.colours.copy())
        self.observations.append(
            {player.name: dict(game.observe(player)) for player in game.players}
        )


def record(*overrides, longest_s=None, policy=random_policy):
    """Play an episode by random actions, or another policy that is made for the environment."""
    game = compose(list(overrides)).game.with_waveform()
    recorded = Recorded()
    with (
        closing(VecaEnv(game, 1, 3)) as env,
        torch.no_grad(),
        set_exploration_type(ExplorationType.DETERMINISTIC),
    ):
        recorder = EpisodeRecorder(env, longest_s)
        for step, played in enumerate(play(env, policy(env))):
            if step == 0:
                recorder.begin()
            else:
                recorder.add(played)
                if recorder.is_cut:
                    break
                recorded.played.append(played.clone())
            recorded.copy(env.games[0])
        recorded.weights = env.games[0].weights
        details = {"policy": "random"}
        recorded.episode = recorder.episode(game.task.name, details, RATE_HZ)
    return recorded
