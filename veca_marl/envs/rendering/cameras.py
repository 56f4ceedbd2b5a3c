"""Where the camera of a film is: behind an agent, round it, above, in a corner, or in its eyes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import Player
from veca_marl.sim.body.sense_organs import EYES
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Bools, Floats, Pose
from veca_marl.sim.physics.rooms import RoomCfg
from veca_marl.sim.vision import Camera, look_at


class CameraKind(Enum):
    """What a camera does.

    Attributes:
        auto: `follow` for one walking agent, `orbit` for other bodies, `room` for several agents.
        follow: Stays behind the agent and above its head, and turns with it.
        orbit: Turns slowly round the agents.
        room: Stays in an upper corner of the room, and turns and zooms to the agents.
        above: Looks down on the room.
        eyes: Is between the eyes of the agent.
    """

    auto = "auto"
    follow = "follow"
    orbit = "orbit"
    room = "room"
    above = "above"
    eyes = "eyes"


class Shot(NamedTuple):
    """A camera at one moment.

    Attributes:
        pose: x axis forward, y left, z up.
        fov_deg: Vertical field of view.
        hidden: ``(S,)`` surfaces that it does not see; None for none.
    """

    pose: Pose
    fov_deg: float
    hidden: Bools | None = None


_STEADY_S = 0.6  # time constant with which a camera follows
_JUMP_S = 1.0  # a longer time between two shots is a cut
_FRAMED = 0.82  # fraction of the picture for what is framed
_UP = np.array([0.0, 0.0, 1.0])


class CameraOperator:
    """Chooses the shot of every moment of a game; it never changes the game.

    Args:
        game: The game.
        kind: What the camera does.
        players: The agents to show, at least one; the first is the one to follow.
        aspect: Width of the picture as a multiple of its height.
    """

    def __init__(self, game: Game, kind: CameraKind, players: Sequence[str], aspect: float) -> None:
        self._game, self._names, self._aspect = game, list(players), aspect
        self._kind = _chosen(game, self._names) if kind is CameraKind.auto else kind
        self._time_s = math.inf
        self._steady: dict[str, Floats] = {}

    def shot(self) -> Shot:
        """Return the shot of this moment."""
        time_s = self._game.steps * self._game.cfg.clock.step_s
        passed_s = time_s - self._time_s
        if not 0.0 <= passed_s <= _JUMP_S:
            self._steady, passed_s = {}, 0.0
        self._keep = math.exp(-passed_s / _STEADY_S)
        self._time_s = time_s
        shots = {
            CameraKind.follow: self._follow,
            CameraKind.orbit: self._orbit,
            CameraKind.room: self._room,
            CameraKind.above: self._above,
            CameraKind.eyes: self._eyes,
        }
        return shots[self._kind]()

    @property
    def _players(self) -> list[Player]:
        """The agents: a game makes new bodies when a simulation breaks down."""
        players = {player.name: player for player in self._game.players}
        return [players[name] for name in self._names]

    def _smooth(self, name: str, value: Floats) -> Floats:
        """Return a value that follows another one smoothly."""
        before = self._steady.get(name, value)
        self._steady[name] = value + self._keep * (before - value)
        return self._steady[name]

    def _follow(self) -> Shot:
        body = self._players[0].body
        ahead = np.array([*body.forward[:2], 0.0])
        heading = self._smooth("heading", ahead / max(float(np.linalg.norm(ahead)), 1e-9))
        heading = heading / max(float(np.linalg.norm(heading)), 1e-9)
        ground = self._smooth("ground", np.array([*body.position[:2], 0.0]))
        target = ground + 0.55 * heading + 0.38 * _UP
        aside = np.cross(_UP, heading)
        eye = ground - 1.5 * heading + 0.55 * aside + 1.2 * _UP
        head = np.array([*body.position[:2], 0.6])
        return Shot(look_at(self._reached(head, eye), target), 47.0)

    def _orbit(self) -> Shot:
        points = self._points()
        low, high = points.min(axis=0), points.max(axis=0)
        target = self._smooth("target", (low + high) / 2.0)
        first = self._players[0].body.forward
        start = self._steady.setdefault("start", np.array([math.atan2(first[1], first[0])]))[0]
        yaw = start + math.radians(-38.0) + math.radians(14.0) * self._time_s
        pitch = math.radians(27.0)
        way = np.array(
            [math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch)]
        )
        fov_deg = 38.0
        radius = float(np.linalg.norm(points - target, axis=1).max())
        away = self._smooth("away", np.array([radius]))[0] / math.sin(math.radians(fov_deg) / 2.0)
        eye = self._reached(target, target + max(0.85 * away, 0.9) * way)
        return Shot(look_at(eye, target), self._fitting(eye, target, points, (24.0, 80.0)))

    def _room(self) -> Shot:
        room = self._room_of_players()
        low, size = np.array(room.lower_m), np.array(room.size_m)
        points = self._points()
        target = self._smooth("target", (points.min(axis=0) + points.max(axis=0)) / 2.0)
        corners = [low + size * (x, y, 0.85) for x in (0.05, 0.95) for y in (0.05, 0.95)]
        centre = low[:2] + size[:2] / 2.0
        # the corner behind which there is most of the room, for the whole episode
        far = np.argmax([np.linalg.norm(c[:2] - target[:2]) for c in corners])
        eye = self._steady.setdefault("eye", corners[int(far)])
        aim = target + 0.12 * (np.array([*centre, target[2]]) - target)
        return Shot(look_at(eye, aim), self._fitting(eye, aim, points, (14.0, 70.0)))

    def _above(self) -> Shot:
        room = self._room_of_players()
        low, size = np.array(room.lower_m), np.array(room.size_m)
        up = np.array([0.0, 1.0, 0.0])
        turned = (size[0] >= size[1]) == (self._aspect >= 1.0)
        if not turned:
            up = np.array([1.0, 0.0, 0.0])
        tall, wide = (size[1], size[0]) if turned else (size[0], size[1])
        fov_deg = 40.0
        # in a large room the agent is followed, up to the walls
        half = min(max(tall, wide / self._aspect) / 2.0 * 1.08, _ABOVE_M)
        halves = half * (np.array([self._aspect, 1.0]) if turned else np.array([1.0, self._aspect]))
        middle, reach = low[:2] + size[:2] / 2.0, np.maximum(size[:2] / 2.0 - 0.9 * halves, 0.0)
        place = self._smooth("place", self._players[0].body.position[:2])
        middle += np.clip(place - middle, -reach, reach)
        height = 0.6 + half / math.tan(math.radians(fov_deg) / 2.0)
        eye = np.array([*middle, low[2] + height])
        forward = -_UP
        return Shot(Pose(eye, np.stack([forward, np.cross(up, forward), up], axis=1)), fov_deg)

    def _eyes(self) -> Shot:
        body = self._players[0].body
        left, right = (body.mount(name) for name in EYES)
        hidden = self._game.world.scene.hidden(body.object_id, body.own_head_frames)
        return Shot(Pose((left.position + right.position) / 2.0, left.rotation), 60.0, hidden)

    def _points(self) -> Floats:
        """Return points of what is to be in the picture, ``(N, 3)`` metres."""
        scene = self._game.world.scene
        points = []
        for player in self._players:
            item = scene.objects[player.body.object_id]
            vertices = scene.meshes.vertices[item.vertices]
            points.append(vertices[::16] if len(vertices) else item.positions)
        near = np.concatenate(points)
        things = [
            thing
            for thing in _things(self._game)
            if np.linalg.norm(near - thing, axis=1).min() < _NEAR_M
        ]
        return np.concatenate([near, *(thing[None] for thing in things)])

    def _fitting(
        self, eye: Floats, target: Floats, points: Floats, limits_deg: tuple[float, float]
    ) -> float:
        """Return the vertical field of view that has all points in the picture, degrees."""
        forward, left, up = ((points - eye) @ look_at(eye, target).rotation).T
        slopes = np.maximum(np.abs(left) / self._aspect, np.abs(up)) / np.maximum(forward, 0.05)
        needed = 2.0 * math.degrees(math.atan(float(slopes.max()) / _FRAMED))
        return float(self._smooth("fov", np.array([np.clip(needed, *limits_deg)]))[0])

    def _reached(self, origin: Floats, eye: Floats) -> Floats:
        """Return the camera's position, moved towards a point where something is between."""
        scene, way = self._game.world.scene, eye - origin
        length = float(np.linalg.norm(way))
        shown = [item.id for item in scene.objects if item.id not in self._standing()]
        hidden = np.isin(scene.surfaces.objects, shown)
        probe = Camera(9, 9, fov_deg=12.0)
        free = float(probe.render(scene, [look_at(origin, eye)], hidden).depth.min())
        fraction = min(max((free - _CLEAR_M) / length, 0.15), 1.0)
        before = float(self._steady.get("reach", np.ones(1))[0])
        if fraction < before:  # at once, since a wall must not hide the agent
            self._steady["reach"] = np.array([fraction])
        else:
            fraction = float(self._smooth("reach", np.array([fraction]))[0])
        return origin + fraction * way

    def _standing(self) -> set[int]:
        """Return the ids of what stands in the way of a camera: fixed props and doors."""
        props = self._game.world.props.values()
        return {prop.object_id for prop in props if prop.fixed or prop.joint is not None}

    def _room_of_players(self) -> RoomCfg:
        """Return the room in which the first agent is, or the nearest one."""
        place = tuple(self._players[0].body.position[:2])
        rooms = self._game.cfg.playground.rooms
        return min(rooms, key=lambda room: room.distance_m((float(place[0]), float(place[1]))))


_NEAR_M, _CLEAR_M, _ABOVE_M = 1.2, 0.12, 1.9


def _chosen(game: Game, names: Sequence[str]) -> CameraKind:
    """Return what `auto` stands for."""
    if len(names) > 1:
        return CameraKind.room
    body = next(player.body for player in game.players if player.name == names[0])
    return CameraKind.follow if isinstance(body, Walker) else CameraKind.orbit


def _things(game: Game) -> list[Floats]:
    """Return the positions of the movable things of the task, not of the playground."""
    furniture = {prop.name for prop in game.cfg.playground.built_props()}
    return [
        prop.position
        for name, prop in game.world.props.items()
        if name not in furniture and not prop.fixed
    ]
