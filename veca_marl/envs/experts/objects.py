"""Experts of the tasks with objects: grasping, moving, rotating, piling up, putting down."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, TaskT, register_expert
from veca_marl.envs.core.task import Player, horizontal
from veca_marl.envs.experts.control.carrying import (
    BENT,
    UPRIGHT,
    CarryCfg,
    carry,
    lift,
    return_to_rest,
)
from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion
from veca_marl.envs.tasks.objects.grab_object import GrabObject
from veca_marl.envs.tasks.objects.move_to_target import MoveToTarget
from veca_marl.envs.tasks.objects.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.objects.put_down_block import PutDownBlock
from veca_marl.envs.tasks.objects.rotate_cube import SHOULDER, RotateCube
from veca_marl.envs.tasks.objects.toys_and_blocks import height_in_edges
from veca_marl.sim.body.humanoid.postures import OFFERING, reaching
from veca_marl.sim.geometry import Floats, heading_rad
from veca_marl.sim.physics import Prop


class CarryingExpert(Expert[TaskT]):
    """Commands the joints by a sequence of target angles that starts with each episode.

    It plays at control rates from 21 to 245 Hz, at which its motion takes the same time. Slower
    feedback than that does not balance the trunk: at 15 Hz the body topples or misses the thing.

    Args:
        task: The rules that are played.
        player: The player that the commands are for.
        palms: Controller of both hands.
    """

    reads = ()
    control_rates_hz = (21, 245)

    def __init__(self, task: TaskT, player: Player, palms: PalmMotion) -> None:
        super().__init__(task, player)
        self._palms = palms

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._palms.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    @abstractmethod
    def _script(self) -> Iterator[Floats]:
        """Yield target angles ``(82,)`` in rad, one array per step, without end."""


_SETTLING_S, _PILED_EDGES = 1.2, 0.5
_PILE_CLEARANCE_M = 0.035  # of the carried block above the other one
# high palms, since thumbs that press on the rear edge tilt the block by 20 to 40 degrees
_PILING = CarryCfg(squeeze_m=0.025, speed_mps=0.125, thumbs_m=0.012, levelling_per_s=2.5)


@register_expert("PileUpBlock")
class PileUpBlockExpert(CarryingExpert[PileUpBlock]):
    """Presses a red block between both palms, carries it over the other one and releases it.

    Starts again after losing the block, until the task is solved for the first time after a
    release: from then on its hands rest, also if the pile falls later. Reads the poses of the
    blocks and of its own bones, whether the task is solved, and the angles, velocities and
    strengths of its joints from the simulator (privileged); with position control also the forces
    on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: PileUpBlock, player: Player) -> None:
        super().__init__(
            task, player, PalmMotion(task.child, task.world.clock.step_s, posture_gain_per_s=0.25)
        )

    def _script(self) -> Iterator[Floats]:
        height_m = 1.5 * self.task.cfg.edge_m + _PILE_CLEARANCE_M
        for block, base in itertools.cycle(itertools.permutations(self.task.red)):
            yield from carry(self._palms, block, partial(_on_top_of, base), height_m, _PILING)
            yield from self._let_settle(block)
            if self.task.solved(self.player):
                yield from return_to_rest(self._palms)

    def _let_settle(self, block: Prop) -> Iterator[Floats]:
        """Hold the hands still while a block that has been put down still moves.

        A pile sways after it was released: it is not solved yet, but must not be gripped.
        """
        here = Grip(self._palms.middle, self._palms.gap_m)
        for _ in range(self._palms.steps(_SETTLING_S)):
            if self.task.solved(self.player) or height_in_edges(block) < _PILED_EDGES:
                return
            yield self._palms.move(here)


def _on_top_of(base: Prop) -> Floats:
    """Return the centre of a block that lies on another one, ``(3,)`` metres."""
    x, y, z = base.position
    return np.array([x, y, z + base.cfg.size_m[0]])


_LIFT_M = 0.10


@register_expert("GrabObject")
class GrabObjectExpert(CarryingExpert[GrabObject]):
    """Presses the toy between both palms and lifts it; starts again after losing it.

    Reads the poses of the toy and of its own bones, and the angles, velocities and strengths of its
    joints from the simulator (privileged); with position control also the forces on its joints.
    Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: GrabObject, player: Player) -> None:
        step_s = task.world.clock.step_s
        palms = PalmMotion(task.child, step_s, UPRIGHT, BENT, posture_gain_per_s=0.25)
        super().__init__(task, player, palms)

    def _script(self) -> Iterator[Floats]:
        height_m = self.task.cfg.edge_m / 2 + _LIFT_M
        return lift(self.task.child, self._palms, self.task.toy, height_m)


_MARK_CLEARANCE_M = 0.03  # of the carried toy above the floor


@register_expert("MoveToTarget")
class MoveToTargetExpert(CarryingExpert[MoveToTarget]):
    """Presses the toy between both palms, carries it over the mark and releases it.

    Starts again after losing the toy, until a released toy is on the mark: from then on its hands
    rest. Reads the poses of the toy, the mark and its own bones, and the angles, velocities and
    strengths of its joints from the simulator (privileged); with position control also the forces
    on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: MoveToTarget, player: Player) -> None:
        super().__init__(task, player, PalmMotion(task.child, task.world.clock.step_s))

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        height_m = cfg.edge_m / 2 + _MARK_CLEARANCE_M
        while not self.task.distance_m < 0.5 * cfg.solved_m:
            yield from carry(self._palms, self.task.toy, self._goal, height_m, CarryCfg())
        yield from return_to_rest(self._palms)

    def _goal(self) -> Floats:
        """Return the centre of a toy that lies on the mark, ``(3,)`` metres."""
        height = np.array([0.0, 0.0, self.task.cfg.edge_m / 2])
        goal: Floats = horizontal(self.task.mark.position) + height
        return goal


# a weak grip: with a force of 10 N the palms push the tower forwards by 20 mm
_PUTTING_DOWN = CarryCfg(squeeze_m=0.012, above_m=0.02, over_m=(0.03, 0.02, 0.03))
_TOWER_CLEARANCE_M = 0.035  # of the carried block above the tower
_ASIDE_M = 0.11  # distance of its goal from the sagittal plane of the child
# of the postures that were tried, these knock over the fewest towers
_UPRIGHT, _BENT = reaching(20.0, 20.0), reaching(30.0, 22.0)


@register_expert("PutDownBlock")
class PutDownBlockExpert(CarryingExpert[PutDownBlock]):
    """Presses the red block between both palms, lifts it off and puts it on the floor beside.

    Starts again after losing the block, until the task is solved after a release: from then on its
    hands rest. Reads the poses of the blocks and of its own bones, whether the task is solved, and
    the angles, velocities and strengths of its joints from the simulator (privileged); with
    position control also the forces on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: PutDownBlock, player: Player) -> None:
        step_s = task.world.clock.step_s
        palms = PalmMotion(task.child, step_s, _UPRIGHT, _BENT, posture_gain_per_s=0.25)
        super().__init__(task, player, palms)

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        height_m = (cfg.blue + 0.5) * cfg.edge_m + _TOWER_CLEARANCE_M
        while not self.task.solved(self.player):
            yield from carry(self._palms, self.task.red, self._goal, height_m, _PUTTING_DOWN)
        yield from return_to_rest(self._palms)

    def _goal(self) -> Floats:
        """Return a place on the floor on the other side of the child, ``(3,)`` metres."""
        x, y, _ = self.task.blue[0].position
        return np.array([x, -math.copysign(_ASIDE_M, y), self.task.cfg.edge_m / 2])


_GAIN_PER_S = 1.25  # change of the target angles, as a share of the remaining angle
_MAX_SPEED_RADPS = math.radians(37.5)  # faster, the cube slides off
_JOINTS = (SHOULDER, "r_hand.radial_deviation")
_TILT_JOINT = "r_upper_arm.flexion"


@register_expert("RotateCube")
class RotateCubeExpert(Expert[RotateCube]):
    """Turns shoulder and wrist until the cube on the palm has reached its target orientation.

    Flexion of the upper arm keeps the palm level meanwhile. The fingers do not move. Reads the
    orientation of the cube and of its target from the simulator (privileged). Plays at control
    rates from 21 to 245 Hz: at 15 Hz it drops the cube in most episodes.
    """

    reads = ()
    control_rates_hz = (21, 245)

    def __init__(self, task: RotateCube, player: Player) -> None:
        super().__init__(task, player)
        self._step_s = task.world.clock.step_s
        names = task.child.joint_names
        self._joints = [names.index(name) for name in _JOINTS]
        self._tilt_joint = names.index(_TILT_JOINT)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._angles = self.task.child.posture_angles(OFFERING)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        turn = self.task.target @ self.task.cube.rotation.T
        # for the right arm of a child on its back, abduction and radial deviation turn to the right
        self._angles[self._joints] -= self._change(heading_rad(turn)) / len(self._joints)
        # the arm points to the right (-y): its flexion tilts what lies on the palm about y, by the
        # angle in the antisymmetric part of a rotation that is small but for the heading
        self._angles[self._tilt_joint] -= self._change((turn[0, 2] - turn[2, 0]) / 2)
        return self._angles

    def _change(self, error_rad: float) -> float:
        """Return the change of target angles in a step."""
        most_rad = _MAX_SPEED_RADPS * self._step_s
        return float(np.clip(_GAIN_PER_S * self._step_s * error_rad, -most_rad, most_rad))
