"""BabyzumasRevenge: take the key from the drawer, open the door, go into the next room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, register_task, require_walker, terms
from veca_marl.envs.tasks.floors.places import (
    clearances_m,
    free_place,
    furniture_of,
    place_player,
    planned_furniture,
)
from veca_marl.envs.tasks.floors.playability import check_placement
from veca_marl.sim.body.anatomy.growth import OLDEST_MONTHS
from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.geometry import Floats, rotation_about_vertical
from veca_marl.sim.physics import (
    DoorCfg,
    LockCfg,
    PlannedProp,
    PlaygroundCfg,
    Prop,
    PropCfg,
    RoomCfg,
    StandingProp,
    World,
)
from veca_marl.sim.physics.houses.door_leaves import first_met
from veca_marl.sim.physics.props.containers import cupboard_with_drawer
from veca_marl.sim.physics.props.doors import LEAF_M, LEAF_WALL_M, door_leaf
from veca_marl.sim.physics.props.toys import key
from veca_marl.sim.sound import SoundCfg, SoundKind

_DEPTH_M, _WIDTH_M, _HEIGHT_M = 0.4, 0.45, 0.5
_WALL_GAP_M = 0.02
_CORNER_M = 0.6  # from the middle of the cupboard
_FRONT_M = 0.8  # floor in front of the middle that stays free
_CLEAR_M = 0.4  # from furniture
_KEY_BEHIND_M = 0.03  # the middle of the cupboard: above it the open drawer does not hide the key
_DRAWS = 1000


class KeyDrawer(NamedTuple):
    """The props.

    Attributes:
        cupboard: The fixed part.
        drawer: Slides out of it, to the x axis of both frames.
        key: Lies in the drawer.
    """

    cupboard: Prop
    drawer: Prop
    key: Prop

    def place(self, place: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, with the key in the drawer."""
        x, y, z = place
        for prop in (self.cupboard, self.drawer):
            prop.place((x, y, z + prop.cfg.position_m[2]), yaw_rad)
        floor = self.drawer.cfg.parts[0]
        height_m = self.drawer.cfg.position_m[2] + floor.position_m[2] + floor.size_m[2] / 2.0
        behind = rotation_about_vertical(yaw_rad)[:, 0] * _KEY_BEHIND_M
        lying_m = z + height_m + self.key.cfg.position_m[2]
        self.key.place((x - behind[0], y - behind[1], lying_m), yaw_rad + math.pi / 2.0)


def add_key_drawer(world: World, key_sound: SoundCfg) -> KeyDrawer:
    """Add a cupboard with a drawer that opens, and a key, to a world that is not frozen yet."""
    case, drawer = _cupboard()
    return KeyDrawer(
        world.add_prop(case),
        world.add_prop(drawer),
        world.add_prop(replace(key("key", (0.0, 0.0)), sound=key_sound)),
    )


def planned_cupboard() -> PlannedProp:
    """Return the cupboard of `add_key_drawer` without a world, for trials of its placement."""
    return PlannedProp(_cupboard()[0])


def _cupboard() -> list[PropCfg]:
    size_m = (_DEPTH_M, _WIDTH_M, _HEIGHT_M)
    return cupboard_with_drawer("cupboard", (0.0, 0.0), size_m=size_m)


def draw_place_at_wall(
    room: RoomCfg,
    furniture: Sequence[StandingProp],
    avoided: Floats,
    apart_m: float,
    rng: np.random.Generator,
) -> tuple[Floats, float]:
    """Draw a place of the cupboard with its back to a wall of a room.

    Args:
        room: The room.
        furniture: Props to keep away from, with the floor in front as well.
        avoided: ``(2,)`` metres: the middle of a door.
        apart_m: Least distance from it.
        rng: Random generator of the episode.

    Returns:
        The point ``(3,)`` of the floor, metres, and the yaw.

    Raises:
        ValueError: If none of 1000 draws fits, or a wall is too short for the cupboard.
    """
    is_wide = min(room.size_m[:2]) >= 2.0 * _CORNER_M
    for _ in range(_DRAWS if is_wide else 0):
        place, yaw_rad = _random_place(room, rng)
        front = place + _FRONT_M * rotation_about_vertical(yaw_rad)[:, 0]
        ends = np.array([place[:2], front[:2]])
        far = math.dist(place[:2], avoided) >= apart_m
        if far and all((clearances_m(prop, ends) >= _CLEAR_M).all() for prop in furniture):
            return place, yaw_rad
    raise ValueError(
        f"room {room.name!r} of {room.extent} leaves no place for a cupboard at a wall, "
        f"{_CORNER_M} m from the corners and {apart_m} m from the door"
    )


def _random_place(room: RoomCfg, rng: np.random.Generator) -> tuple[Floats, float]:
    """Draw a wall and a place along it; return the point of the floor and the yaw into the room."""
    axis, far = int(rng.integers(2)), bool(rng.integers(2))
    low, size = np.array(room.lower_m), np.array(room.size_m)
    inset_m = _WALL_GAP_M + _DEPTH_M / 2.0
    place = low.copy()
    place[axis] += size[axis] - inset_m if far else inset_m
    place[1 - axis] += rng.uniform(_CORNER_M, size[1 - axis] - _CORNER_M)
    return place, math.pi * (0.5 * axis + (1.0 if far else 0.0))


OPEN = 0.8
"""Opening from which the drawer and the door count as open."""
_DOOR_APART_M = 1.3  # of the cupboard from the middle of the door
_START_CLEAR_M = 0.45  # of the start from walls and things
_HANDMADE_M = 2.0  # height of the doors in walls that are props
_THRESHOLD_M = 0.2  # behind the border of the next room it counts as entered


@dataclass
class BabyzumasRevengeCfg(TaskCfg):
    """Parameters of BabyzumasRevenge. None of the numbers is in the paper.

    Attributes:
        loudness: Rms pressure of the sound of the key at 1 m; 0 for a silent key.
        frequency_hz: Pitch of its sound.
    """

    max_seconds: float = 60.0
    loudness: float = 0.05
    frequency_hz: float = 600.0
    weights: dict[str, float] = terms(drawer=0.0, key=0.0, door=0.0, room=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_not_negative("loudness")
        self.sound()

    def sound(self) -> SoundCfg:
        """Return the sound of the key."""
        return SoundCfg(SoundKind.buzz, self.frequency_hz, self.loudness)


@register_task
class BabyzumasRevenge(Task):
    """An agent has to find the key that opens the door to the next room.

    The agent starts in the first room of the playground that has one door, without a leaf of its
    own. A locked leaf closes that door. A cupboard stands at a wall, at a position drawn for each
    episode. Its drawer is opened with the verb `open`; the key inside can then be seen and taken
    with `grab`. With the key in the hand, `open` unlocks and opens the door. A verb is applied to
    what is nearest to the centre of the view, up to 1.5 m away, of the things that declare it. The
    episode terminates when the agent is in the next room; then the task is solved (`solved`).

    Senses, actions (a continuous `move` and the discrete `verb`; a discrete `move` beside the verb
    is not in the paper) and the sequence of interactions are those of the paper (table of tasks in
    the appendix), which gives it as an example of a first room that has to be cleared; further
    rooms are not described there. The paper does not state the reward, which is sparse. Here
    entering the next room is the only reward by default; the other terms report the progress and
    can be given weights. They cannot be had twice. The key emits a quiet buzz, so that the ears
    tell where the drawer is: what is to be heard is not stated in the paper either. The head is
    pitched 25 degrees down, as in ColorSort.

    Terms:
        drawer: 1 on the step in which the drawer is open for the first time, else 0.
        key: 1 on the step in which the agent takes the key for the first time, else 0.
        door: 1 on the step in which the door is open for the first time, else 0.
        room: 1 on the step in which the agent enters the next room, else 0.
    """

    senses: ClassVar[tuple[str, ...]] = ("vision", "audio")
    body_cfg = WalkerCfg
    ages_months = (6.0, OLDEST_MONTHS)  # smaller ones do not see into the drawer
    verbs = ("grab", "open")
    cfg: BabyzumasRevengeCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        room, door = _start_of(playground)
        _check_thickness(playground, door)
        _leaf_of(playground, room, door)
        furniture, cupboard = planned_furniture(playground), planned_cupboard()
        check_placement(
            lambda rng: _try_start(room, door, furniture, cupboard, rng),
            f"BabyzumasRevenge in room {room.name!r} of playground {playground.name!r}",
            "a larger room with less furniture, such as playground=two_rooms",
        )

    def build(self) -> None:
        self.walker = require_walker(self.players[0])
        playground = self.world.playground
        self._furniture = furniture_of(self.world)
        self.room, doorway = _start_of(playground)
        self._next = _room_behind(playground, doorway, self.room)
        self.doorway = np.array(doorway.position_m)
        self.out = direction_out(self.room, self.doorway)
        self.door = self.world.add_prop(_leaf_of(playground, self.room, doorway))
        self.cupboard, self.drawer, self.key = self._drawer = add_key_drawer(
            self.world, self.cfg.sound()
        )
        self._done: frozenset[str] = frozenset()
        self._new: frozenset[str] = frozenset()

    def reset(self, rng: np.random.Generator) -> None:
        place, yaw_rad = draw_place_at_wall(
            self.room, self._furniture, self.doorway, _DOOR_APART_M, rng
        )
        self._drawer.place(place, yaw_rad)
        things = [*self._furniture, self.cupboard]
        start = free_place(self.room, things, _START_CLEAR_M, rng)
        place_player(self.players[0], start, rng.uniform(-math.pi, math.pi))
        self._done = self._new = frozenset()

    def after_step(self, rng: np.random.Generator) -> None:
        here = self.walker.position
        reached = {
            "drawer": self.drawer.opening >= OPEN,
            "key": self.walker.held is self.key,
            "door": self.door.opening >= OPEN,
            "room": self._next.contains(here, _THRESHOLD_M),
        }
        self._new = frozenset(name for name in reached if reached[name]) - self._done
        self._done |= self._new

    def reward(self, player: Player) -> dict[str, float]:
        return {name: float(name in self._new) for name in ("drawer", "key", "door", "room")}

    def state(self) -> dict[str, float]:
        return {name: float(name in self._done) for name in ("drawer", "key", "door", "room")}

    def terminated(self) -> bool:
        return "room" in self._done

    def solved(self, player: Player) -> bool:
        """Return whether the agent has entered the next room."""
        return "room" in self._done


def direction_out(room: RoomCfg, place: Floats) -> Floats:
    """Return the horizontal unit vector ``(3,)`` out of a room at a place ``(2,)`` in its wall."""
    low = np.array(room.lower_m[:2])
    away_m = np.abs(np.stack([place - low, place - low - room.size_m[:2]]))
    far, axis = np.unravel_index(int(np.argmin(away_m)), away_m.shape)
    out: Floats = np.zeros(3)
    out[axis] = 1.0 if far else -1.0
    return out


def _try_start(
    room: RoomCfg,
    door: DoorCfg,
    furniture: Sequence[PlannedProp],
    cupboard: PlannedProp,
    rng: np.random.Generator,
) -> None:
    """Draw the places of the cupboard and of the agent as at the start of an episode."""
    doorway = np.array(door.position_m)
    cupboard.place(*draw_place_at_wall(room, furniture, doorway, _DOOR_APART_M, rng))
    free_place(room, [*furniture, cupboard], _START_CLEAR_M, rng)


def _start_of(playground: PlaygroundCfg) -> tuple[RoomCfg, DoorCfg]:
    """Return the first room that a locked leaf in its only door closes, and that door.

    Raises:
        ValueError: If each room has several doors, none, or one that has a leaf already.
    """
    for room in playground.rooms:
        doors = [door for door in playground.doors if room.name in door.rooms]
        if len(doors) == 1 and doors[0].leaf is None:
            return room, doors[0]
    raise ValueError(
        "BabyzumasRevenge starts in a room that has one door, without a leaf of its own; "
        f"playground {playground.name!r} has none: choose playground=two_rooms, three_rooms, "
        "seven_rooms or house2, or random_house with another playground.seed, fewer "
        "playground.leaves or playground.loops=0"
    )


def _check_thickness(playground: PlaygroundCfg, door: DoorCfg) -> None:
    """Check that the closed leaf is inside its wall, where the walls are built.

    Raises:
        ValueError: If the walls are too thin.
    """
    walls = playground.walls
    if walls is not None and walls.thickness_m < LEAF_WALL_M:
        raise ValueError(
            f"BabyzumasRevenge closes door {door.name!r} of playground {playground.name!r} with a "
            f"leaf of {LEAF_M} m, for which walls.thickness_m={walls.thickness_m} is too thin; "
            f"choose at least {LEAF_WALL_M}, or playground=two_rooms"
        )


def _leaf_of(playground: PlaygroundCfg, room: RoomCfg, door: DoorCfg) -> PropCfg:
    """Return the locked leaf of a door; it opens out of the room, its hinge where it meets nothing.

    Raises:
        ValueError: If it meets a wall or a piece of furniture with the hinge at either end.
    """
    out = direction_out(room, np.array(door.position_m))
    yaw_deg = math.degrees(math.atan2(out[1], out[0]))
    leaf = partial(
        door_leaf,
        "door_leaf",
        door.position_m,
        width_m=door.width_m,
        height_m=_leaf_height_m(playground, door),
        lock=LockCfg("key"),
    )
    ends = [leaf(yaw_deg=yaw_deg), leaf(yaw_deg=yaw_deg + 180.0, opens_to_front=False)]
    things = [prop for prop in playground.built_props() if prop.tangible and prop.mass_kg == 0.0]
    met = [first_met(end, things) for end in ends]
    for end, hindrance in zip(ends, met, strict=True):
        if hindrance is None:
            return end
    names = " and ".join(repr(hindrance.thing.name) for hindrance in met if hindrance)
    raise ValueError(
        f"BabyzumasRevenge closes door {door.name!r} of playground {playground.name!r} with a "
        f"leaf that meets {names} before it is open; choose another playground.seed, less "
        "furniture or playground=two_rooms"
    )


def _leaf_height_m(playground: PlaygroundCfg, door: DoorCfg) -> float:
    """Return the clear height of a door, metres: the wall over it would hold a higher leaf."""
    if playground.walls is None:
        return _HANDMADE_M
    rooms_m = [room.size_m[2] for room in playground.rooms if room.name in door.rooms]
    return min(playground.walls.door_height_m, max(rooms_m))


def _room_behind(playground: PlaygroundCfg, door: DoorCfg, room: RoomCfg) -> RoomCfg:
    """Return the room on the other side of a door of a room."""
    other = next(name for name in door.rooms if name != room.name)
    return next(room for room in playground.rooms if room.name == other)
