"""Records an episode of a TorchRL environment while it is played, for a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tensordict import TensorDictBase
from torchrl.envs.utils import step_mdp

from veca_marl.algos.evaluation.evaluate import ActionPolicy
from veca_marl.algos.networks.memory import with_memory
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import SOLVED, Player
from veca_marl.envs.rendering import touch_readings
from veca_marl.runs.episode_page.episode import (
    Agent,
    Episode,
    Geometry,
    Repainting,
    SceneInfo,
)
from veca_marl.runs.episode_page.media import picture_sheet
from veca_marl.sim.body import Body
from veca_marl.sim.body.sense_organs import EYES
from veca_marl.sim.geometry import Mesh, Scene, SceneObject, Shape
from veca_marl.sim.sense import ArraySpec

TOUCH_LEVELS = 255  # readings are stored in steps of 1/255, rounded up: what touches is never 0
WAVEFORM = "waveform"


def play(env: VecaEnv, policy: ActionPolicy) -> Iterator[TensorDictBase]:
    """Play one episode; yield its start, then what the environment returned for each step.

    Args:
        env: An environment of one world.
        policy: Writes the actions of all teams.
    """
    playing = with_memory(env, policy)
    state, done = playing.reset(), False
    yield state
    while not done:
        played = playing.step(policy(state))
        state, done = step_mdp(played), bool(played["next", "done"].all())
        yield played


class EpisodeRecorder:
    """Samples the first world of an environment after each step.

    It reads what the agents observe and never changes the game: call `begin` after the reset, `add`
    after each step, and `episode` at the end.

    Attributes:
        is_cut: Whether a step was left out, since the recording was as long as it may be, or the
            simulation broke down.

    Args:
        env: The environment, with the samples of the ears (`GameCfg.with_waveform`) for sound.
        longest_s: Seconds after which nothing more is recorded; None for no limit.
    """

    def __init__(self, env: VecaEnv, longest_s: float | None = None) -> None:
        self._env = env
        self._step_s = env.cfg.clock.step_s
        self.is_cut = False
        self._most = None if longest_s is None else max(round(longest_s / self._step_s), 1)

    def begin(self) -> None:
        """Forget what was recorded, and record the start of the present episode."""
        self._game: Game = self._env.games[0]
        scene = self._game.world.scene
        self._scene = _scene_info(self._game)
        self._colours = scene.surfaces.colours.copy()
        self._positions: list[NDArray[Any]] = []
        self._rotations: list[NDArray[Any]] = []
        self._repaintings: list[Repainting] = []
        self.is_cut = False
        frames = len(scene.positions)
        self._tracks = [
            _Track(self._game, player, frames + 2 * number)
            for number, player in enumerate(self._game.players)
        ]
        self._sample()

    @property
    def steps(self) -> int:
        """Steps recorded so far, the start left out."""
        return len(self._positions) - 1

    def record(self, episode: Iterable[TensorDictBase]) -> None:
        """Record an episode as `play` yields it, no longer than the recording may be."""
        steps = iter(episode)
        next(steps)
        self.begin()
        for played in steps:
            self.add(played)
            if self.is_cut:
                return

    def add(self, played: TensorDictBase) -> None:
        """Record the step that was just played.

        Args:
            played: What `step` of the environment returned: actions, and `next`.
        """
        is_full = self._most is not None and self.steps >= self._most
        # after a step that broke the simulation down there is nothing to show
        if self.is_cut or is_full or not np.isfinite(self._game.world.scene.positions).all():
            self.is_cut = True
            return
        self._sample()
        for team, names in self._env.group_map.items():
            for number, name in enumerate(names):
                track = next(each for each in self._tracks if each.agent.name == name)
                track.add_step(played, team, number)

    def _sample(self) -> None:
        scene = self._game.world.scene
        eyes = [track.body.mount(eye) for track in self._tracks for eye in EYES]
        self._positions.append(np.vstack([scene.positions, *(eye.position for eye in eyes)]))
        turns = [scene.rotations, np.stack([eye.rotation for eye in eyes])]
        self._rotations.append(np.concatenate(turns))
        self._sample_colours(scene)
        for track in self._tracks:
            track.sample(self._game.observe(track.player))

    def _sample_colours(self, scene: Scene) -> None:
        colours = scene.surfaces.colours
        changed = np.flatnonzero((colours != self._colours).any(axis=1))
        if len(changed):
            step = len(self._positions) - 1
            new = np.round(colours[changed].astype(float), 4)
            self._repaintings.append(Repainting(step, changed.tolist(), new.tolist()))
            self._colours = colours.copy()

    def episode(self, title: str, details: dict[str, Any], sample_rate_hz: int) -> Episode:
        """Return what was recorded.

        Args:
            title: What was played.
            details: Further lines by name, such as the policy.
            sample_rate_hz: Of the sounds at the ears.
        """
        rotations = np.stack(self._rotations)
        flat = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat()
        return Episode(
            title,
            details,
            self._step_s,
            sample_rate_hz,
            self._scene,
            np.stack(self._positions),
            _continuous(flat.reshape(*rotations.shape[:2], 4)),
            self._repaintings,
            [track.finished() for track in self._tracks],
            self.is_cut,
        )


def _continuous(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``(N, F, 4)`` with signs so that neighbours in time are on the same side."""
    flips = (quaternions[1:] * quaternions[:-1]).sum(axis=2) < 0.0
    signs = np.ones(quaternions.shape[:2])
    signs[1:] = np.where(np.cumsum(flips, axis=0) % 2, -1.0, 1.0)
    signed: NDArray[np.float64] = quaternions * signs[..., None]
    return signed


def _scene_info(game: Game) -> SceneInfo:
    scene = game.world.scene
    primitives = len(scene.geoms.shapes)
    rooms = [
        (room.lower_m, np.add(room.lower_m, room.size_m)) for room in game.cfg.playground.rooms
    ]
    return SceneInfo(
        objects=[item.name for item in scene.objects],
        geometries=[_geometry(scene, int(row)) for row in np.flatnonzero(scene.geoms.visible)],
        skins={
            o.id: _skin(scene, o) for o in scene.objects if o.triangles.start < o.triangles.stop
        },
        first_frames=[item.rows.start for item in scene.objects],
        first_triangles=[primitives + item.triangles.start for item in scene.objects],
        colours=scene.surfaces.colours.copy(),
        rooms=np.array(rooms, np.float64).reshape(-1, 2, 3),
    )


def _geometry(scene: Scene, row: int) -> Geometry:
    table = scene.geoms
    shape, size = Shape(int(table.shapes[row])), table.sizes[row]
    corners = np.zeros((0, 3, 3))
    if shape is Shape.POLYHEDRON:
        first, count = int(size[0]), int(size[1])
        corners = table.faces[first : first + count, 4:13].reshape(-1, 3, 3)
    return Geometry(
        shape.name.lower(),
        tuple(float(value) for value in size),
        row,
        int(table.frames[row]),
        int(table.objects[row]),
        table.offsets[row].copy(),
        table.local_rotations[row].copy(),
        float(table.checkers[row]),
        bool(table.transparent[row]),
        corners.copy(),
    )


def _skin(scene: Scene, item: SceneObject) -> Mesh:
    """Return the mesh of an object, as it was given to the scene."""
    meshes, first = scene.meshes, len(scene.geoms.shapes)
    surfaces = slice(first + item.triangles.start, first + item.triangles.stop)
    return Mesh(
        frames=meshes.frames[item.vertices] - item.rows.start,
        weights=meshes.weights[item.vertices].copy(),
        offsets=meshes.offsets[item.vertices].copy(),
        triangles=meshes.triangles[item.triangles] - item.vertices.start,
        owners=scene.surfaces.frames[surfaces] - item.rows.start,
        colours=scene.surfaces.colours[surfaces].copy(),
    )


class _Track:
    """What one player senses and does, step by step.

    Args:
        game: The game.
        player: The player.
        first_eye: Number of the frame of its left eye.
    """

    def __init__(self, game: Game, player: Player, first_eye: int) -> None:
        body: Body = player.body
        self.player, self.body = player, body
        hidden = [int(frame) for frame in body.own_head_frames]
        self.agent = Agent(player.name, player.team, body.object_id, hidden, first_eye)
        self.agent.fov_deg = game.cfg.senses_of(player.team).of("vision").fov_deg
        self._weights = game.weights
        for part, spec in body.action_spec.items():
            self.agent.action_names[part] = _value_names(part, spec)
            if spec.is_discrete:
                self.agent.choices[part] = list(spec.names)
        self._pending: list[NDArray[np.uint8]] = []
        self._sound: list[NDArray[np.float32]] = []
        self._terms: list[dict[str, float]] = []
        self._actions: list[dict[str, NDArray[Any]]] = []
        self._solved: list[bool] = []

    def sample(self, observation: dict[str, NDArray[Any]]) -> None:
        """Record what it senses now."""
        agent = self.agent
        if "vision" in observation:
            self._see(observation["vision"])
        readings = touch_readings(observation)
        if readings is not None:
            levels = np.ceil(TOUCH_LEVELS * readings.ravel().clip(0.0, 1.0)).astype(np.uint8)
            touched = np.flatnonzero(levels).astype(np.uint16)
            agent.touch = [*(agent.touch or []), (touched, levels[touched])]
        if WAVEFORM in observation:
            self._sound.append(observation[WAVEFORM].astype(np.float32))

    def _see(self, pictures: NDArray[np.uint8]) -> None:
        agent = self.agent
        if agent.pictures is None:
            agent.pictures, agent.picture_size = [], pictures.shape[-2:]
        self._pending.append(pictures.copy())
        if len(self._pending) == agent.sheet_steps:
            self._end_sheet()

    def _end_sheet(self) -> None:
        if self._pending and self.agent.pictures is not None:
            self.agent.pictures.append(picture_sheet(self._pending))
            self._pending = []

    def add_step(self, played: TensorDictBase, team: str, number: int) -> None:
        """Record its action and its reward terms."""
        read = _reader(number)
        action = played.get((team, "action"))
        parts = self.agent.action_names
        if isinstance(action, TensorDictBase):
            self._actions.append({part: read(action.get(part)) for part in parts})
        else:
            self._actions.append({part: read(action) for part in parts})
        info = played.get(("next", team, "info"))
        terms = {
            name: weight * float(read(info.get(name))[0]) for name, weight in self._weights.items()
        }
        self._terms.append(terms)
        names = info.keys()
        if SOLVED in names:
            self._solved.append(bool(read(info.get(SOLVED))[0]))

    def finished(self) -> Agent:
        """Return everything that was recorded."""
        self._end_sheet()
        agent = self.agent
        if self._sound:
            # the samples of the start lie before the first step
            agent.waveform = np.concatenate([self._sound[0][:, :0], *self._sound[1:]], axis=1)
        if self._terms:
            agent.terms = {
                name: np.array([terms[name] for terms in self._terms]) for name in self._weights
            }
            agent.actions = {
                part: np.stack([action[part] for action in self._actions])
                for part in agent.action_names
            }
        if self._solved:
            agent.solved = np.array(self._solved)
        return agent


def _value_names(part: str, spec: ArraySpec) -> list[str]:
    count = int(np.prod(spec.shape, dtype=int))
    if count == 1:
        return [part]
    if len(spec.names) == count:
        return list(spec.names)
    return [f"{part} {number}" for number in range(count)]


def _reader(number: int) -> Callable[[Any], NDArray[np.float64]]:
    """Return what reads the values of one player of a team in the first world, flat."""

    def read(tensor: Any) -> NDArray[np.float64]:
        values: NDArray[Any] = tensor[0, number].numpy(force=True)
        return values.astype(np.float64).reshape(-1)

    return read
