"""One world: a PyBullet client, its clock, its named props, its sound and whoever moves in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry.primitives import Shape
from veca_marl.sim.geometry.scene import Scene
from veca_marl.sim.geometry.tables import Geom
from veca_marl.sim.physics.bullet import pybullet
from veca_marl.sim.physics.playground import PlaygroundCfg
from veca_marl.sim.physics.props import Prop, PropCfg, mirror
from veca_marl.sim.sound.acoustics import Room
from veca_marl.sim.sound.house import House
from veca_marl.sim.sound.soundfield import SoundField
from veca_marl.sim.sound.sounds import make_sound

GRAVITY_MPS2 = 9.81
_FLOOR_THICKNESS_M = 0.1


@dataclass
class ClockCfg:
    """The constant clock: physics, sound and animation advance by it, wall time has no influence.

    The paper's VECATime. 25 Hz divides the sampling rate of the ears (22 050 Hz) evenly.

    Attributes:
        control_rate_hz: Agent steps per second.
        substeps: Physics steps per agent step.
        solver_iterations: Iterations of Bullet's constraint solver per physics step.
        contact_share: How near, as a share of the size of the smaller of two things, physics looks
            ahead to their contact. What crosses more in one physics step has sunk in before it is
            noticed; 0.1 sees a palm-sized thing 5 mm ahead, at twice the price of physics.
    """

    control_rate_hz: int = 25
    substeps: int = 5
    solver_iterations: int = 10
    contact_share: float = 0.02

    def __post_init__(self) -> None:
        """Only rates that give whole blocks of samples keep sound and physics together."""
        if self.control_rate_hz <= 0 or 22050 % self.control_rate_hz:
            raise ValueError(
                f"control_rate_hz={self.control_rate_hz} must divide 22050: 10, 15, 18, 21, 25, 30"
            )
        if self.substeps < 1 or self.solver_iterations < 1:
            raise ValueError("substeps and solver_iterations must be at least 1")
        if not 0.0 < self.contact_share <= 1.0:
            raise ValueError(f"contact_share={self.contact_share} must be above 0 and at most 1")

    @property
    def step_s(self) -> float:
        """Duration of an agent step."""
        return 1.0 / self.control_rate_hz

    @property
    def substep_s(self) -> float:
        """Duration of a physics step."""
        return self.step_s / self.substeps


class Mover(Protocol):
    """Whoever moves in a world by its own will."""

    def reset(self) -> None:
        """Be as when it was made: the physics was just restored."""

    def before_step(self) -> None:
        """Look round once per agent step, before the first substep."""

    def before_substep(self, substep_s: float) -> None:
        """Move or apply forces, just before the physics."""

    def mirror(self) -> None:
        """Write the drawn frames and the sound positions, once per agent step."""


class World:
    """Named things under one clock.

    Build it once: `add_prop`, `attach`, then `freeze`; afterwards `reset` restores the built state
    and the caller adds the random part with `Prop.place` and `refresh`.

    Attributes:
        version: Counts steps, resets and refreshes. A sense computes its values once per version.
        step_count: Agent steps since the world was built; a reset does not set it back.
    """

    def __init__(self, playground: PlaygroundCfg, clock: ClockCfg | None = None) -> None:
        self.playground = playground
        self.clock = clock or ClockCfg()
        self.scene = Scene()
        self.house = House(
            [Room(room.lower_m, room.size_m, room.reflection) for room in playground.rooms],
            playground.image_order,
            playground.transmission_loss_db,
        )
        self.sound = SoundField(self.house, step_samples=22050 // self.clock.control_rate_hz)
        self.version = 0
        self.step_count = 0
        self.client: int = pybullet.connect(pybullet.DIRECT)
        self.props: dict[str, Prop] = {}
        self.movers: list[Mover] = []
        self.after_substep: list[Callable[[], None]] = []
        self._state: int | None = None
        self._moving: list[Prop] = []
        self._prepare_physics()
        self._lay_floor()
        for prop in playground.props:
            self.add_prop(prop)

    def add_prop(self, cfg: PropCfg) -> Prop:
        """Put a new prop into the world; raise `ValueError` if the name is taken."""
        self._refuse_if_frozen(f"add the prop {cfg.name!r}")
        if cfg.name in self.props or cfg.name == "floor":
            taken = ["floor", *self.props]
            raise ValueError(f"the name {cfg.name!r} is taken; there are {taken}")
        sound = None if cfg.sound is None else make_sound(cfg.sound)
        source = None if sound is None else self.sound.add_source(cfg.name, sound)
        prop = Prop(cfg, self.client, self.scene, source, self.house.obstacles)
        self.props[cfg.name] = prop
        if not prop.fixed:
            self._moving.append(prop)
        return prop

    def prop(self, name: str) -> Prop:
        """Return a prop; raise `KeyError` with the names that exist."""
        try:
            return self.props[name]
        except KeyError:
            raise KeyError(f"no prop {name!r}; there are {sorted(self.props)}") from None

    def attach(self, mover: Mover) -> None:
        """Let somebody move in this world."""
        self._refuse_if_frozen("attach a body")
        self.movers.append(mover)

    def freeze(self) -> None:
        """Remember the built state: `reset` comes back to it."""
        self._refuse_if_frozen("freeze it again")
        # Bullet forgets the contacts of the last episode only if the saved state holds contacts:
        # without them, what touches at the start moves otherwise than in a fresh world
        self._look_ahead()
        pybullet.performCollisionDetection(physicsClientId=self.client)
        self._state = pybullet.saveState(physicsClientId=self.client)

    def reset(self, rng: np.random.Generator) -> None:
        """Restore the built state, bit by bit, and start all sounds anew.

        Args:
            rng: Source of the sounds' phases and noises.
        """
        if self._state is None:
            raise RuntimeError("freeze() the world before its first reset()")
        self.version += 1
        self._look_ahead()
        pybullet.restoreState(self._state, physicsClientId=self.client)
        self.sound.reset(rng)
        mirror(list(self.props.values()))
        for mover in self.movers:
            mover.reset()

    def refresh(self) -> None:
        """Show what was placed by hand: draw it, and let its sound spread for one step."""
        self._mirror()
        self.sound.advance()
        self.version += 1

    def step(self) -> None:
        """Advance by one agent step."""
        self._look_ahead()
        for mover in self.movers:
            mover.before_step()
        for _ in range(self.clock.substeps):
            for mover in self.movers:
                mover.before_substep(self.clock.substep_s)
            pybullet.stepSimulation(physicsClientId=self.client)
            for notify in self.after_substep:
                notify()
        self._mirror()
        self.sound.advance()
        self.step_count += 1
        self.version += 1

    def close(self) -> None:
        """Give the PyBullet client back. Closing twice is harmless."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _look_ahead(self) -> None:
        """Say how near contacts are looked for: Bullet keeps one number for all its worlds."""
        pybullet.setPhysicsEngineParameter(
            contactBreakingThreshold=self.clock.contact_share, physicsClientId=self.client
        )

    def _mirror(self) -> None:
        mirror(self._moving)
        for mover in self.movers:
            mover.mirror()
        self.scene.update()

    def _refuse_if_frozen(self, what: str) -> None:
        if self._state is not None:
            raise RuntimeError(f"the world is frozen: too late to {what}")

    def _prepare_physics(self) -> None:
        pybullet.setGravity(0.0, 0.0, -GRAVITY_MPS2, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.clock.substep_s,
            numSolverIterations=self.clock.solver_iterations,
            # without it a restored world drifts away from a fresh one
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def _lay_floor(self) -> None:
        look = self.playground
        half = (look.floor_size_m[0] / 2, look.floor_size_m[1] / 2, _FLOOR_THICKNESS_M / 2)
        geom = Geom(
            Shape.BOX,
            half,
            colour=look.floor_colour,
            offset=(*look.floor_centre_m, -half[2]),
            checker_m=look.floor_checker_m,
        )
        self.scene.add_object("floor", [[geom]])
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self.client)
        self.floor_id: int = pybullet.createMultiBody(0, plane, physicsClientId=self.client)
        pybullet.changeDynamics(
            self.floor_id, -1, lateralFriction=1.0, restitution=1.0, physicsClientId=self.client
        )
