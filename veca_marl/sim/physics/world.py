"""A world: a PyBullet client, its clock, floor, named props and sound, and the bodies in it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.physics.bullet import BuiltContacts
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.physics.bullet_state import (
    restore_state,
    saved_state,
    sleeping_bodies,
    solve_in_order,
    solving_order,
)
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.impact_sounds import ImpactSounds
from veca_marl.sim.physics.interactions import check_interactions
from veca_marl.sim.physics.playground import PlaygroundCfg, make_house
from veca_marl.sim.physics.props import (
    Prop,
    PropCfg,
    copy_all_poses,
    follow_physics,
    limit_detection,
    prop_sleep,
)
from veca_marl.sim.physics.props.contact_corrections import FastProps, Rebounds
from veca_marl.sim.physics.props.joint import Joint
from veca_marl.sim.physics.world_state import (
    BuiltState,
    BulletSetting,
    SavedPhysics,
    built_state,
)
from veca_marl.sim.sound import SoundField, make_sound

FLOOR_NAME = "floor"
_FLOOR_THICKNESS_M = 0.1


def add_floor(client: BulletClient, scene: Scene, playground: PlaygroundCfg) -> int:
    """Add the floor to Bullet and to the scene; return its id in Bullet.

    Its friction and restitution are 1: Bullet multiplies them by those of what touches it.
    """
    x, y = playground.floor_size_m
    half = (x / 2, y / 2, _FLOOR_THICKNESS_M / 2)
    geom = Geom(
        Shape.BOX,
        half,
        offset=(*playground.floor_centre_m, -half[2]),
        colour=playground.floor_colour,
        checker_m=playground.floor_checker_m,
    )
    scene.add_object(FLOOR_NAME, [[geom]])
    plane = client.createCollisionShape(pybullet.GEOM_PLANE)
    floor_id: int = client.createMultiBody(0, plane)
    client.changeDynamics(floor_id, -1, lateralFriction=1.0, restitution=1.0)
    return floor_id


def check_keys(props: Mapping[str, Prop]) -> None:
    """Check that the key of each lock is a prop that can be carried to it.

    Args:
        props: All props of a world by name.

    Raises:
        ValueError: If a key is no prop, or a fixed one; the message lists the loose props.
    """
    for name, prop in props.items():
        lock = None if prop.cfg.joint is None else prop.cfg.joint.lock
        if lock is None or not lock.key:
            continue
        key = props.get(lock.key)
        if key is None or key.fixed:
            fault = "is no prop" if key is None else "is a fixed prop"
            loose = sorted(
                each for each, one in props.items() if not one.fixed and one.joint is None
            )
            raise ValueError(
                f"prop {name!r}: the key {lock.key!r} of its lock {fault}; choose one of the loose "
                f"props {loose}, or an empty name for a lock that no prop opens"
            )


class Mover(Protocol):
    """A body, or a group of bodies, that acts in a world: see `World.attach`."""

    def reset(self) -> None:
        """Return to the state at construction, after Bullet's state has been restored."""

    def before_step(self) -> None:
        """Prepare an agent step, before its first physics step."""

    @property
    def needs_physics(self) -> bool:
        """Whether it acts in the physics steps of this agent step, once that is prepared."""
        ...

    def before_substep(self, substep_s: float) -> None:
        """Move or apply forces, before each physics step of `substep_s` seconds."""

    def after_substep(self, substep_s: float) -> None:
        """Read the state after each physics step, and apply limits of the body."""

    def write_frames(self) -> None:
        """Write the frames of the scene and the positions of sounds, once per agent step."""


_FALLING_ASLEEP = 2  # physics steps until Bullet leaves out what may sleep
GRAVITY_MPS2 = 9.81


class World:
    """Props and bodies under one clock.

    Build it once: `add_prop` and `attach`, then `freeze`. Afterwards `reset` restores the built
    state; the caller adds the random part with `Prop.place` and calls `refresh`.

    Attributes:
        playground: What it was built from.
        clock: Its time steps.
        scene: What eyes see and skins feel.
        house: Its rooms and what stands between them, as sound meets them.
        sound: Its sound sources and listeners.
        client: The PyBullet client.
        floor_id: PyBullet's id of the floor.
        props: Its props by name.
        movers: The bodies in it.
        after_substep: Functions of observers, called at the end of every physics step.
        settings: What `restore_physics` sets beside Bullet's saved state.
        version: Counts steps, resets and refreshes. A sense computes its values once per version.
        step_count: Agent steps since the world was built; a reset does not set it back.
        broken_props: Names of props whose simulated pose is not finite any more. What eyes and ears
            perceive stays as it was before. Bullet's collision detection does not recover from
            numbers that are not finite, whatever is restored, so the world must be rebuilt.
    """

    def __init__(self, playground: PlaygroundCfg, clock: ClockCfg | None = None) -> None:
        self.playground = playground
        self.clock = clock or ClockCfg()
        self.scene = Scene()
        self.house = make_house(playground)
        self.sound = SoundField(self.house, step_samples=self.clock.step_samples)
        self.client = BulletClient()
        self.props: dict[str, Prop] = {}
        self.movers: list[Mover] = []
        self.after_substep: list[Callable[[], None]] = []
        self.settings: list[BulletSetting] = []
        self.version = 0
        self.step_count = 0
        self.broken_props: list[str] = []
        self._state: int | None = None
        self._order: list[tuple[int, int]] = []
        self._contacts: BuiltContacts
        self._built: BuiltState | None = None
        self._moving: list[Prop] = []
        self._joints: list[Joint] = []
        self._sleep = prop_sleep(self.client, self.clock)
        self._fast = FastProps(self.client, self.scene, self.clock.substep_s)
        self._rebounds = Rebounds(self.client, self.clock.substep_s)
        self._configure_physics()
        self._impacts: ImpactSounds | None = None
        if playground.impacts.present:
            self._impacts = ImpactSounds(playground.impacts, self.clock, self.client, self.sound)
        self.floor_id = add_floor(self.client, self.scene, playground)
        for prop in playground.built_props():
            self.add_prop(prop)

    def add_prop(self, cfg: PropCfg) -> Prop:
        """Add a prop.

        Raises:
            ValueError: If the name is taken, an interaction is not registered, or the parent of
                its joint is missing or not fixed.
            RuntimeError: If the world is frozen.
        """
        self._check_not_frozen(f"add the prop {cfg.name!r}")
        taken = [FLOOR_NAME, *self.props]
        if cfg.name in taken:
            raise ValueError(f"the name {cfg.name!r} is taken; there are {taken}")
        check_interactions(f"prop {cfg.name!r}: interactions", cfg.interactions)
        parent = self._joint_parent(cfg)
        sound = None if cfg.sound is None else make_sound(cfg.sound)
        source = None if sound is None else self.sound.add_source(cfg.name, sound)
        prop = Prop(cfg, self.client, self.scene, source, self.house.obstacles)
        limit_detection(prop.body_id, prop.links, cfg, self.client, self.clock)
        self.props[cfg.name] = prop
        if prop.joint is not None:
            self._add_joint(prop, prop.joint, parent)
        if self._impacts is not None:
            self._impacts.add(prop)
        prop.rest = self._sleep.add(prop)
        self._fast.add(prop)
        self._rebounds.add(prop)
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
        """Let a body act in this world; raise `RuntimeError` if the world is frozen."""
        self._check_not_frozen("attach a body")
        self.movers.append(mover)

    def require_solver_iterations(self, count: int) -> None:
        """Let Bullet's solver make at least a number of iterations per physics step.

        Raises:
            RuntimeError: If the world is frozen.
        """
        self._check_not_frozen("change its solver")
        current = self.client.getPhysicsEngineParameters()
        self.client.setPhysicsEngineParameter(
            numSolverIterations=max(count, current["numSolverIterations"])
        )

    def freeze(self) -> None:
        """Save the built state, to which `reset` returns. Nothing can be added afterwards.

        Raises:
            ValueError: If the key of a lock is no prop of this world, or a fixed one.
            RuntimeError: If the world is frozen.
        """
        self._check_not_frozen("freeze it again")
        check_keys(self.props)
        # bodies set filters of collisions when they meet new things, and these change the order in
        # which Bullet solves contacts: none may be left for the first episode
        for mover in self.movers:
            mover.reset()
        self._set_contact_share()
        self.client.performCollisionDetection()
        self._contacts = BuiltContacts(self.client, self.floor_id)
        with self._contacts.forgotten():
            self._state = self.client.saveState()
        self._order = solving_order(saved_state(self.client))
        self._built = built_state(self.scene, self.sound.sources)
        for joint in self._joints:
            joint.save()

    def reset(self, rng: np.random.Generator) -> None:
        """Restore the built state, bit by bit, and restart all sounds.

        This covers poses and velocities, colours (`SceneObject.paint`), and which sound each source
        emits and whether it is muted.

        Args:
            rng: Source of the sounds' phases and noises.

        Raises:
            RuntimeError: If the world is not frozen.
        """
        if self._state is None or self._built is None:
            raise RuntimeError("freeze() the world before its first reset()")
        self.version += 1
        self._set_contact_share()
        if self._sleep.wake_all():
            self._simulate()
        solve_in_order(self.client, self._order)  # filters of the last episode have changed it
        with self._contacts.forgotten():
            self.client.restoreState(self._state)
        self._built.restore(self.scene)
        self.sound.reset(rng)
        if self._impacts is not None:
            self._impacts.reset()
        for joint in self._joints:
            joint.reset()
        copy_all_poses(list(self.props.values()))
        for mover in self.movers:
            mover.reset()

    def save_physics(self) -> SavedPhysics:
        """Return what Bullet knows at the end of a step; see `restore_physics`."""
        return SavedPhysics(saved_state(self.client), self.client.gravity())

    def restore_physics(self, saved: SavedPhysics, put_back: Callable[[], None]) -> None:
        """Return Bullet to an earlier state, of this world or of one that was built like it.

        Args:
            saved: The state.
            put_back: Sets the attributes of the world, and of all that is in it, to those that
                belong to the state.

        Raises:
            pybullet.error: If the state is that of another world.
        """
        self._set_contact_share()
        for setting in self.settings:
            setting.forget()
        woken = self._sleep.wake_all()
        restore_state(self.client, saved.state)
        self.client.setGravity(*saved.gravity)
        put_back()
        for setting in self.settings:
            setting.apply()
        if self._sleep.resume(sleeping_bodies(self.client, saved.state)) or woken:
            for _ in range(_FALLING_ASLEEP):
                self.client.stepSimulation()
            restore_state(self.client, saved.state)
        self._sleep.fall_asleep()

    def refresh(self) -> None:
        """Show what was placed by hand: update the scene, and emit one step of sound.

        It is for the start of an episode: to the velocities and accelerations that bodies sense,
        it is a step in which they stand still.
        """
        self._update_scene()
        self.sound.advance()
        self.version += 1

    def step(self) -> None:
        """Advance by one agent step."""
        self._set_contact_share()
        for mover in self.movers:
            mover.before_step()
        self._sleep.before_step()
        if self._needs_physics():
            self._fast.before_step()
            for _ in range(self.clock.substeps):
                self._substep()
        self._update_scene()
        self._sleep.after_step(self.scene)
        self.sound.advance()
        self.step_count += 1
        self.version += 1

    def _needs_physics(self) -> bool:
        """Return whether physics steps could change anything in this agent step."""
        acting = any(mover.needs_physics for mover in self.movers)
        return acting or bool(self.after_substep) or not self._sleep.all_asleep

    def _substep(self) -> None:
        """Advance by one physics step: move, simulate, apply limits, observe."""
        substep_s = self.clock.substep_s
        for mover in self.movers:
            mover.before_substep(substep_s)
        self._fast.before_substep()
        self._simulate()
        for joint in self._joints:
            joint.after_substep()
        if self._impacts is not None:  # sounds follow from where joints were stopped
            self._impacts.after_substep()
        for mover in self.movers:
            mover.after_substep(substep_s)
        for observe in self.after_substep:
            observe()

    def _simulate(self) -> None:
        """Let Bullet make a physics step."""
        self._rebounds.before_substep()
        self._sleep.before_substep()
        self.client.stepSimulation()
        self._sleep.after_substep()
        self._rebounds.after_substep()

    def overlap_m(self, one: int, other: int) -> float:
        """Return how deep two bodies penetrate each other where they are now, in metres.

        Args:
            one: PyBullet's id of a body.
            other: That of another, or of the same one: parts of it that collide with each other.

        Returns:
            The greatest depth; 0 if they are apart, or if Bullet does not let them collide.
        """
        self.client.performCollisionDetection()
        contacts = self.client.getContactPoints(one, other)
        return max((-contact.distance_m for contact in contacts), default=0.0)

    def touches_props(self, body_id: int) -> bool:
        """Return whether a body penetrates a prop where it is now."""
        self.client.performCollisionDetection()
        contacts = self.client.getContactPoints(body_id)
        touched = {contact.body_b for contact in contacts if contact.distance_m < 0}
        return any(prop.body_id in touched for prop in self.props.values())

    def close(self) -> None:
        """Disconnect from PyBullet. Closing twice is harmless.

        A world that is no longer referenced disconnects by itself, see `BulletClient`.
        """
        self.client.close()

    def _update_scene(self) -> None:
        moved = [prop for prop in self._moving if prop.may_have_moved]
        self.broken_props = follow_physics(moved) or self.broken_props
        for mover in self.movers:
            mover.write_frames()
        self.scene.update()

    def _joint_parent(self, cfg: PropCfg) -> Prop | None:
        """Return the fixed prop that a prop is attached to; None for the world."""
        if cfg.joint is None or not cfg.joint.parent:
            return None
        fixed = sorted(name for name, prop in self.props.items() if prop.fixed)
        if cfg.joint.parent not in fixed:
            raise ValueError(
                f"prop {cfg.name!r}: joint.parent={cfg.joint.parent!r} must be a fixed prop that "
                f"was added before; there are {fixed}"
            )
        return self.props[cfg.joint.parent]

    def _add_joint(self, prop: Prop, joint: Joint, parent: Prop | None) -> None:
        """Let a joint act after each physics step; the two props that it joins do not collide."""
        self._joints.append(joint)
        self.settings.append(joint)
        if parent is None:
            return
        for ours, theirs in itertools.product(prop.links, parent.links):
            self.client.setCollisionFilterPair(parent.body_id, prop.body_id, theirs, ours, 0)

    def _check_not_frozen(self, what: str) -> None:
        if self._state is not None:
            raise RuntimeError(f"the world is frozen: too late to {what}")

    def _set_contact_share(self) -> None:
        """Set Bullet's detection distance of contacts: it keeps one number for all its clients."""
        self.client.setPhysicsEngineParameter(contactBreakingThreshold=self.clock.contact_share)

    def _configure_physics(self) -> None:
        self.client.setGravity(0.0, 0.0, -GRAVITY_MPS2)
        self.client.setPhysicsEngineParameter(
            fixedTimeStep=self.clock.substep_s,
            numSolverIterations=self.clock.solver_iterations,
            # Bullet would stop earlier for all bodies that it solves together; which these are
            # depends on contacts of the last episode, and so would the last digits of this one
            solverResidualThreshold=0.0,
            # without it a restored world drifts away from a fresh one
            deterministicOverlappingPairs=1,
        )
