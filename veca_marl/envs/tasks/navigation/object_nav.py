"""ObjectNav and ObjectPhysNav: go to the one object among several that is the target."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, register_task, require_humanoid, terms
from veca_marl.envs.tasks.floors.outlines import check_reach
from veca_marl.envs.tasks.floors.places import (
    Spacing,
    direct_gaze_ahead,
    furniture_of,
    gap_m,
    place_player,
    planned_furniture,
    scattered_places,
    wide_rooms,
)
from veca_marl.envs.tasks.floors.playability import check_connected, check_placement
from veca_marl.envs.tasks.navigation.helper_reward import AHEAD_WEIGHT, TURN_WEIGHT, HelperReward
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlannedProp, PlaygroundCfg, Prop, PropCfg, PropShape, World


class ObjectKind(Enum):
    """Kinds of objects, each of one shape and colour.

    Attributes:
        doll: A child in violet clothes.
        ball: A red sphere.
        pyramid: A yellow pyramid.
        cube: A blue cube.
        cylinder: A green cylinder.
    """

    doll = "doll"
    ball = "ball"
    pyramid = "pyramid"
    cube = "cube"
    cylinder = "cylinder"


class _Look(NamedTuple):
    """Shape, size, height of the centre above the floor, and colour of a kind."""

    shape: PropShape
    size_m: tuple[float, ...]
    centre_m: float
    colour: tuple[float, float, float]


_LOOKS = {
    ObjectKind.doll: _Look(PropShape.doll, (0.36,), 0.18, (0.55, 0.2, 0.65)),
    ObjectKind.ball: _Look(PropShape.sphere, (0.15,), 0.15, (0.95, 0.15, 0.1)),
    ObjectKind.pyramid: _Look(PropShape.pyramid, (0.28, 0.28, 0.3), 0.15, (0.95, 0.8, 0.1)),
    ObjectKind.cube: _Look(PropShape.box, (0.25, 0.25, 0.25), 0.125, (0.1, 0.25, 0.9)),
    ObjectKind.cylinder: _Look(PropShape.cylinder, (0.12, 0.3), 0.15, (0.1, 0.7, 0.2)),
}


class SearchedObject(NamedTuple):
    """A fixed object of a kind.

    Attributes:
        prop: The prop.
        centre_m: Height of its centre when it stands on the floor.
    """

    prop: Prop
    centre_m: float

    def place(self, floor: Floats, yaw_rad: float) -> None:
        """Stand on a point ``(3,)`` of the floor, metres."""
        x, y, z = floor
        self.prop.place((x, y, z + self.centre_m), yaw_rad)


def add_object(world: World, name: str, kind: ObjectKind) -> SearchedObject:
    """Add a fixed object of a kind to a world that is not frozen yet."""
    return SearchedObject(world.add_prop(_prop_of(name, kind)), _LOOKS[kind].centre_m)


def radius_m(kind: ObjectKind) -> float:
    """Return the horizontal radius of the objects of a kind, see `Prop.radius_m`."""
    return PlannedProp(_prop_of(kind.name, kind)).radius_m


def _prop_of(name: str, kind: ObjectKind) -> PropCfg:
    look = _LOOKS[kind]
    return PropCfg(name=name, shape=look.shape, size_m=list(look.size_m), colour=look.colour)


_PASSAGE_M = 0.2  # width that an agent at an object leaves free towards furniture and walls
_DOOR_M = 0.9  # objects nearer to the middle of a door could block it


def _default_objects() -> list[ObjectKind]:
    return [ObjectKind.doll, ObjectKind.ball, ObjectKind.pyramid]


@dataclass
class ObjectNavCfg(TaskCfg):
    """Parameters of ObjectNav. None of the numbers but the weights is in the paper.

    Attributes:
        objects: Kinds of all objects, at least 2, see `ObjectKind`; kinds other than the target
            may be repeated.
        target: Kind of the target, once among `objects`. It is the same in all episodes.
        reach_m: Horizontal distance from the pelvis to the surface of an object within which it
            has been reached.
        apart_m: Least distance between the middles of any two objects, and from the start to each;
            larger than the radius of the widest object and `reach_m` together.
    """

    objects: list[ObjectKind] = field(default_factory=_default_objects)
    target: ObjectKind = ObjectKind.ball
    reach_m: float = 0.3
    apart_m: float = 1.2
    weights: dict[str, float] = terms(reached=1.0, wrong=-1.0, ahead=AHEAD_WEIGHT, turn=TURN_WEIGHT)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("reach_m", "apart_m")
        kinds = [kind.name for kind in ObjectKind]
        if not all(isinstance(kind, ObjectKind) for kind in (*self.objects, self.target)):
            raise ValueError(
                f"task.objects={self.objects}, task.target={self.target!r}; choices: {kinds}"
            )
        if len(self.objects) < 2 or self.objects.count(self.target) != 1:
            names = [kind.name for kind in self.objects]
            raise ValueError(
                f"task.objects={names} must be at least 2 and hold task.target="
                f"{self.target.name} once; choices: {kinds}"
            )
        self._check_reach()

    def _check_reach(self) -> None:
        """Raise `ValueError` if an object could be within reach at the start."""
        widest = max(self.objects, key=radius_m)
        if self.reach_m + radius_m(widest) >= self.apart_m:
            raise ValueError(
                f"task.apart_m={self.apart_m:g} must be larger than task.reach_m={self.reach_m:g} "
                f"and the radius of {widest.name}, {radius_m(widest):.2f} m, together: else an "
                "object is reached at the start"
            )


@register_task
class ObjectNav(Task):
    """An agent has to go to the one of several objects that is the target.

    The objects stand at random positions of all rooms, at least `apart_m` from each other and from
    the agent's start. The target is recognised by its shape and colour in the images. Reaching
    the target or a wrong object terminates the episode; the task is solved (`solved`) if it was the
    target.

    Senses, actions, the rewards of +1 and -1 and the helper reward are those of the paper (table
    of tasks and "Helper Rewards" in the appendix). The paper does not state the cue for the
    target, the objects, the distance at which one is reached, and when an episode ends. Here the
    target is of one kind, `target`, in all episodes; the kinds are those that the paper's data sets
    classify, and further ones. Departures: `ahead` is in metres per step, and `turn` stands for the
    sideways velocity that walking bodies do not have, see `HelperReward`.

    Terms:
        reached: 1 on the step in which the target is reached, else 0.
        wrong: 1 on the step in which another object is reached, and the target is not, else 0.
        ahead: Displacement forwards during the step, m (negative backwards), while the target is
            visible to the agent's eyes. In the paper ``Vis a_f``. Its sum
            has no bound: walking in a circle near the object is paid too.
        turn: Decrease of the horizontal angle between the agent's forward direction and the
            direction of the target since the target was last visible, rad, if it is visible after
            the step. In the paper ``Vis a_l L``, see `HelperReward`.
    """

    senses: ClassVar[tuple[str, ...]] = ("vision",)
    cfg: ObjectNavCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        furniture, count = planned_furniture(playground), 1 + len(cfg.objects)
        spacing = _spacing(cfg)
        check_connected(cls.__name__, playground, wide_rooms(playground.rooms, spacing.clear_m))
        check_placement(
            lambda rng: scattered_places(playground, furniture, count, spacing, rng),
            f"{cls.__name__} with {len(cfg.objects)} task.objects, task.apart_m={cfg.apart_m:g} "
            f"and task.reach_m={cfg.reach_m:g}",
            "fewer or smaller ones, or a larger playground, such as playground=house",
        )

    @classmethod
    def check_distances(
        cls, cfg: Any, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
    ) -> None:
        target = PlannedProp(_prop_of("target", cfg.target))
        target.place((0.0, 0.0, _LOOKS[cfg.target].centre_m))
        check_reach(cfg.reach_m, target, bodies)

    def build(self) -> None:
        self.agent = self.players[0]
        self._furniture = furniture_of(self.world)
        self._objects = [
            add_object(self.world, f"object_{number}_{kind.name}", kind)
            for number, kind in enumerate(self.cfg.objects)
        ]
        self.target = self._objects[self.cfg.objects.index(self.cfg.target)].prop
        self.wrong = [one.prop for one in self._objects if one.prop is not self.target]
        self._spacing = _spacing(self.cfg)
        self._helper = HelperReward(self.world.scene)
        self._reached = self._reached_wrong = False

    def reset(self, rng: np.random.Generator) -> None:
        self._reached = self._reached_wrong = False
        start, *floors = scattered_places(
            self.world.playground, self._furniture, 1 + len(self._objects), self._spacing, rng
        )
        for one, floor in zip(self._objects, floors, strict=True):
            one.place(floor, rng.uniform(-math.pi, math.pi))
        place_player(self.agent, start, rng.uniform(-math.pi, math.pi))
        direct_gaze_ahead(self.players)
        self._helper.reset(self.target, self.players)

    def before_step(self, rng: np.random.Generator) -> None:
        self._helper.before_step(self.players)

    def after_step(self, rng: np.random.Generator) -> None:
        direct_gaze_ahead(self.players)
        self._reached = self._is_reached(self.target)
        self._reached_wrong = not self._reached and any(map(self._is_reached, self.wrong))
        self._helper.after_step(self.players)

    def reward(self, player: Player) -> dict[str, float]:
        return {
            "reached": float(self._reached),
            "wrong": float(self._reached_wrong),
            **self._helper.terms(player),
        }

    def terminated(self) -> bool:
        return self._reached or self._reached_wrong

    def solved(self, player: Player) -> bool:
        """Return whether the target has been reached."""
        return self._reached

    def _is_reached(self, prop: Prop) -> bool:
        return gap_m(self.agent.body.position, prop) <= self.cfg.reach_m


def _spacing(cfg: ObjectNavCfg) -> Spacing:
    largest_m = max(map(radius_m, cfg.objects))
    return Spacing(largest_m + cfg.reach_m + _PASSAGE_M, cfg.apart_m, _DOOR_M)


@dataclass
class ObjectPhysNavCfg(ObjectNavCfg):
    """Parameters of ObjectPhysNav: those of ObjectNav, for a body that crawls.

    Attributes:
        reach_m: As in ObjectNav. It is larger, because the head and hands of a body on hands and
            knees are in front of its pelvis.
        apart_m: As in ObjectNav. It is larger, because a body that crawls needs floor to turn.
    """

    max_seconds: float = 60.0
    reach_m: float = 0.5
    apart_m: float = 2.0


@register_task
class ObjectPhysNav(ObjectNav):
    """ObjectNav with a body that is controlled by its joints and starts on hands and knees.

    Objects, rewards and the end of an episode are as in ObjectNav: the task is solved (`solved`)
    when the target has been reached. The agent feels and senses its own body as well. Senses and
    joint-level actions are those of the paper (table of tasks in the appendix); sizes and times are
    not in the paper. Departures: those of ObjectNav's helper reward; the eyes are turned to the
    horizon ahead in each step, because on hands and knees the face points to the floor.

    Terms:
        reached: 1 on the step in which the target is reached, else 0.
        wrong: 1 on the step in which another object is reached, and the target is not, else 0.
        ahead: Displacement forwards during the step, m (negative backwards), while the target is
            visible to the agent's eyes. In the paper ``Vis a_f``. Its sum
            has no bound: walking in a circle near the object is paid too.
        turn: Decrease of the horizontal angle between the agent's forward direction and the
            direction of the target since the target was last visible, rad, if it is visible after
            the step. In the paper ``Vis a_l L``, see `HelperReward`.
    """

    senses = ("vision", "touch", "proprioception")
    body_cfg = HumanoidCfg
    cfg: ObjectPhysNavCfg

    def build(self) -> None:
        require_humanoid(self.players[0])
        super().build()
