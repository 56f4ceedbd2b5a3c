"""Draw why touch is read from geometry: peaks of touch and of the solver's force over the step.

A ball of 0.2 kg falls 2 cm onto the palm, where skin gives way, and onto the forearm, where physics
knows the rigid bone alone. Writes ``docs/images/touch_time_step.png`` and prints the numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np

from veca_marl.sim.bodies.humanoid import Humanoid, HumanoidCfg
from veca_marl.sim.bullet import pybullet
from veca_marl.sim.playground import PlaygroundCfg, RoomCfg
from veca_marl.sim.pose import Floats
from veca_marl.sim.props import PropCfg, PropShape
from veca_marl.sim.senses.touch import TouchCfg, TouchSense
from veca_marl.sim.skeleton import load_skeleton
from veca_marl.sim.taxels import load_taxels
from veca_marl.sim.world import GRAVITY_MPS2, ClockCfg, World

mpl.use("Agg")
import matplotlib.pyplot as plt

PICTURE = Path(__file__).resolve().parent.parent / "docs/images/touch_time_step.png"
SUBSTEPS = (5, 10, 20, 40)
RADIUS_M = 0.05
_CLAMP_N = 1e5


@dataclass(frozen=True)
class Spot:
    """A place on the left arm: a point of the bone in its frame and the way out of the skin."""

    bone: str
    point_m: tuple[float, float, float]
    outward: tuple[float, float, float]


# on the surface of the box and of the capsule that are these bones in the table of bones
PALM = Spot("l_hand", (0.0, -0.006, -0.0265), (0.0, -1.0, 0.0))
FOREARM = Spot("l_forearm", (0.0135, 0.0, -0.0475), (1.0, 0.0, 0.0))


@dataclass(frozen=True)
class Press:
    """What was felt, and what the solver did, after every physics step.

    Attributes:
        touch: ``(n,)`` the largest reading on the bone.
        force_n: ``(n,)`` normal forces between ball and body.
    """

    touch: Floats
    force_n: Floats


def press(spot: Spot, mass_kg: float, substeps: int, fall_m: float, seconds: float) -> Press:
    """Let a ball fall onto an arm held in a vice.

    Nothing has weight but the ball, and it moves along the normal only: so it meets the same skin
    whatever the time step.
    """
    room = RoomCfg(lower_m=(-5.0, -5.0, 0.0), size_m=(10.0, 10.0, 5.0))
    ball_cfg = PropCfg("ball", PropShape.sphere, [RADIUS_M], mass_kg=mass_kg, restitution=0.0)
    playground = PlaygroundCfg(name="vice", rooms=[room], props=[ball_cfg], image_order=0)
    world = World(playground, ClockCfg(substeps=substeps))
    body = Humanoid("child", HumanoidCfg(), world)
    sense = TouchSense(TouchCfg(), body, world.scene)
    world.freeze()
    world.reset(np.random.default_rng(0))
    angles = np.zeros(len(body.joint_names))
    angles[load_skeleton().joint("l_upper_arm", "abduction")] = 0.8
    body.place((0.0, 0.0, 1.0), 0.0, angles)
    pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=world.client)
    body_id, client = body.articulation.body_id, world.client
    _clamp(client, body_id, spot.bone)
    bone = load_skeleton().bone(spot.bone)
    drawn = world.scene.objects[body.object_id]
    rotation = drawn.rotations[bone]
    out = rotation @ np.array(spot.outward)
    gap = load_skeleton().bones[bone].skin_thickness_m + RADIUS_M + fall_m
    ball = world.prop("ball")
    ball.place(drawn.positions[bone] + rotation @ np.array(spot.point_m) + gap * out)
    first = load_taxels().first_triangle
    touch, force = [], []

    def weigh() -> None:
        velocity, _ = pybullet.getBaseVelocity(ball.body_id, physicsClientId=client)
        along = (np.dot(velocity, out) - GRAVITY_MPS2 * world.clock.substep_s) * out
        pybullet.resetBaseVelocity(ball.body_id, along, (0.0, 0.0, 0.0), physicsClientId=client)

    def note() -> None:
        points = pybullet.getContactPoints(ball.body_id, body_id, physicsClientId=client)
        force.append(sum(point[9] for point in points))
        world.refresh()
        touch.append(sense.update_taxels()[first[bone] : first[bone + 1]].max())
        weigh()

    world.after_substep.append(note)
    weigh()
    for _ in range(round(seconds * world.clock.control_rate_hz)):
        world.step()
    world.close()
    return Press(np.array(touch), np.array(force))


def _clamp(client: int, body_id: int, bone: str) -> None:
    """Hold a bone where it is."""
    names = [
        pybullet.getJointInfo(body_id, link, physicsClientId=client)[12].decode()
        for link in range(pybullet.getNumJoints(body_id, physicsClientId=client))
    ]
    link = names.index(bone)
    state = pybullet.getLinkState(body_id, link, 0, 1, physicsClientId=client)
    vice = pybullet.createConstraint(
        body_id,
        link,
        -1,
        -1,
        pybullet.JOINT_FIXED,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        state[0],
        (0.0, 0.0, 0.0, 1.0),
        state[1],
        physicsClientId=client,
    )
    pybullet.changeConstraint(vice, maxForce=_CLAMP_N, physicsClientId=client)


def draw(path: Path) -> None:
    """Measure and draw."""
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.2), layout="constrained")
    step_ms = [40.0 / substeps for substeps in SUBSTEPS]
    for spot, name in ((PALM, "palm (skin yields)"), (FOREARM, "forearm (rigid bone)")):
        falls = [press(spot, 0.2, substeps, fall_m=0.02, seconds=0.2) for substeps in SUBSTEPS]
        touch = [fall.touch.max() for fall in falls]
        force = [fall.force_n.max() for fall in falls]
        for step, felt, pushed in zip(step_ms, touch, force, strict=True):
            print(f"{spot.bone} {step:.0f} ms: peak touch {felt:.3f}, peak force {pushed:.1f} N")
        axes[0].plot(step_ms, touch, "o-", label=name)
        axes[1].plot(step_ms, force, "o-", label=name)
    axes[0].set(ylabel="peak touch T", ylim=(0.0, 1.05))
    axes[1].set(ylabel="peak force of the solver (N)", yscale="log")
    for axis in axes:
        axis.set(xlabel="physics step (ms)", xscale="log")
        axis.set_xticks(step_ms, [f"{step:.0f}" for step in step_ms])
        axis.minorticks_off()
        axis.legend()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(PICTURE)
