"""Sleep of the props of a world while they are at rest, or none.

Bullet puts bodies that touch each other to sleep together, once each of them may sleep, and wakes
them when a moving body comes near. What has no mass wakes nothing in Bullet: a walker wakes the
props within its reach, and so does the world where a fixed prop is put elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Protocol

import numpy as np

from veca_marl.sim.geometry import Floats, Scene, follow_poses
from veca_marl.sim.physics.bullet_client import BulletClient, pybullet
from veca_marl.sim.physics.clock import ClockCfg
from veca_marl.sim.physics.props.prop import Awake, Prop, Rest

REST_SPEED = 0.01
"""Speed in m/s and rad/s below which a prop is at rest.

The default threshold of Unity and PhysX, 0.005 J per kg, is the kinetic energy at ten times this
speed.
"""

_SLEEP = pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP
_WAKE = pybullet.ACTIVATION_STATE_DISABLE_SLEEPING | pybullet.ACTIVATION_STATE_WAKE_UP


class Sleep:
    """Whether Bullet may leave a movable prop out of the simulation.

    Args:
        prop: The prop.
        client: The PyBullet client.
        steps: Agent steps at rest after which it sleeps.
        woken: The props that were woken since the last physics step; it is added when it wakes.

    Attributes:
        is_allowed: Whether Bullet may leave it out, see above.
    """

    def __init__(self, prop: Prop, client: BulletClient, steps: int, woken: list[Prop]) -> None:
        self._prop = prop
        self._client = client
        self._steps = steps
        self._woken = woken
        self._still_steps = 0
        self.is_allowed = False
        # Bullet compares the sum of the squares of all velocities
        client.changeDynamics(prop.body_id, -1, sleepThreshold=REST_SPEED**2)

    def wake(self) -> None:
        """Let Bullet simulate the prop, from the second physics step on; the first does not."""
        self._still_steps = 0
        if self.is_allowed:
            self.is_allowed = False
            self._woken.append(self._prop)
            self._set_state(self._prop.body_id, _WAKE)

    def wake_around(self) -> None:
        """Wake the prop, and what touched it in the last physics step."""
        self.wake()
        points = self._client.getContactPoints(self._prop.body_id)
        for other in sorted({point.body_b for point in points}):
            self._set_state(other, pybullet.ACTIVATION_STATE_WAKE_UP)

    def count(self, still: bool) -> None:
        """Count an agent step, and let the prop sleep when it has been at rest for long enough.

        Args:
            still: Whether the prop was at rest in it.
        """
        self._still_steps = self._still_steps + 1 if still else 0
        self.fall_asleep()

    def fall_asleep(self) -> None:
        """Let the prop sleep if it has just been at rest for long enough."""
        # and again later: a prop that touched it may have woken it since
        if self._still_steps and self._still_steps % self._steps == 0:
            self.is_allowed = True
            self._set_state(self._prop.body_id, _SLEEP)

    def resume(self, asleep: Collection[int]) -> None:
        """Let the prop sleep if it slept when Bullet's state was saved, which was restored now.

        Args:
            asleep: PyBullet's ids of the bodies that slept.
        """
        if self._prop.body_id in asleep:
            self._set_state(self._prop.body_id, _SLEEP)

    def _set_state(self, body_id: int, state: int) -> None:
        self._client.changeDynamics(body_id, -1, activationState=state)


class PropSleep(Protocol):
    """What a world does with its props around each physics step so that they sleep at rest."""

    def add(self, prop: Prop) -> Rest:
        """Add a prop; return what it calls before it is moved."""
        ...

    def before_step(self) -> None:
        """Wake all props if gravity has changed since the last agent step."""
        ...

    @property
    def all_asleep(self) -> bool:
        """Whether no prop can move in a physics step unless something else moves it."""
        ...

    def before_substep(self) -> None:
        """Prepare a physics step of Bullet."""
        ...

    def after_substep(self) -> None:
        """Undo what Bullet did to props that were woken before its physics step."""
        ...

    def after_step(self, scene: Scene) -> None:
        """Let the props sleep that have been at rest for long enough.

        Args:
            scene: Where they are at the end of an agent step.
        """
        ...

    def wake_all(self) -> bool:
        """Wake all props, before Bullet's state is restored, which does not include sleep.

        Returns:
            Whether a physics step must follow, in which Bullet ends their sleep.
        """
        ...

    def resume(self, asleep: Collection[int]) -> bool:
        """Let props sleep that slept when Bullet's state was saved, after it has been restored.

        Args:
            asleep: PyBullet's ids of the bodies that slept.

        Returns:
            Whether there are any; Bullet leaves them out some physics steps later.
        """
        ...

    def fall_asleep(self) -> None:
        """Let those sleep that were let in the last step, after Bullet's state was restored."""
        ...


class NoSleep:
    """The `PropSleep` of a world in which nothing sleeps."""

    def __init__(self) -> None:
        self.all_asleep = True  # as long as all props are fixed

    def add(self, prop: Prop) -> Rest:
        """Return what does nothing before the prop is moved."""
        self.all_asleep = self.all_asleep and prop.fixed
        return Awake()

    def before_step(self) -> None:
        """Do nothing."""

    def before_substep(self) -> None:
        """Do nothing."""

    def after_substep(self) -> None:
        """Do nothing."""

    def after_step(self, scene: Scene) -> None:
        """Do nothing."""

    def wake_all(self) -> bool:
        """Return False: nothing sleeps."""
        return False

    def resume(self, asleep: Collection[int]) -> bool:
        """Return False: nothing sleeps."""
        return False

    def fall_asleep(self) -> None:
        """Do nothing."""


class RestingProps:
    """The `PropSleep` of a world in which props sleep when they are at rest.

    It is itself the `Rest` of the fixed props: when one is put elsewhere, all others wake.

    Args:
        client: The PyBullet client.
        clock: Its `sleep_s` is the time at rest after which a prop sleeps.
    """

    def __init__(self, client: BulletClient, clock: ClockCfg) -> None:
        self._client = client
        self._kept: list[tuple[Prop, Floats, Floats]] = []
        self._steps = math.ceil(clock.sleep_s / clock.step_s)
        self._rest_m = REST_SPEED * clock.step_s
        self._sleeps: list[Sleep] = []
        self._rows = np.zeros(0, np.int64)
        self._woken: list[Prop] = []
        self._motionless = False
        self._positions, self._rotations = _unknown_poses(0)
        self._gravity = client.gravity()

    def add(self, prop: Prop) -> Rest:
        """Add a prop; return what it calls before it is moved."""
        if prop.fixed:
            return self
        self._sleeps.append(Sleep(prop, self._client, self._steps, self._woken))
        self._rows = np.append(self._rows, prop.row)
        self._positions, self._rotations = _unknown_poses(len(self._rows))
        return self._sleeps[-1]

    @property
    def all_asleep(self) -> bool:
        """See `PropSleep`."""
        return self._motionless and not self._woken and all(s.is_allowed for s in self._sleeps)

    def wake(self) -> None:
        """Do nothing: the velocity of a fixed prop is not set."""

    def wake_around(self) -> None:
        """Wake all props."""
        for sleep in self._sleeps:
            sleep.wake()

    def before_step(self) -> None:
        """Wake all props if gravity has changed since the last agent step."""
        gravity = self._client.gravity()
        if gravity != self._gravity:
            self._gravity = gravity
            self.wake_around()

    def before_substep(self) -> None:
        """Note the velocities of props that were woken."""
        if self._woken or self._kept:
            self._kept = [(prop, prop.velocity, prop.angular_velocity) for prop in self._woken]
            self._woken.clear()

    def after_substep(self) -> None:
        """Give props that were woken before the physics step the velocity that they had.

        Bullet sets the velocity of sleeping props to zero in it, and ends the sleep of those that
        were woken only afterwards. A woken prop that has a velocity after the step did not sleep,
        because something beside it moved.
        """
        for prop, velocity, angular_velocity in self._kept:
            if not (prop.velocity.any() or prop.angular_velocity.any()):
                prop.set_velocity(velocity, angular_velocity)

    def after_step(self, scene: Scene) -> None:
        """Let the props sleep that have been at rest for long enough.

        Args:
            scene: Where they are at the end of an agent step.
        """
        frames = scene.positions, scene.rotations, self._rows
        moved = follow_poses(*frames, self._positions, self._rotations)
        self._motionless = not moved.any()
        for sleep, change in zip(self._sleeps, moved.tolist(), strict=True):
            sleep.count(change < self._rest_m)

    def wake_all(self) -> bool:
        """See `PropSleep`."""
        self.wake_around()
        self._positions, self._rotations = _unknown_poses(len(self._rows))
        return bool(self._woken)

    def resume(self, asleep: Collection[int]) -> bool:
        """See `PropSleep`."""
        for sleep in self._sleeps:
            sleep.resume(asleep)
        return bool(asleep)

    def fall_asleep(self) -> None:
        """See `PropSleep`."""
        for sleep in self._sleeps:
            sleep.fall_asleep()


def prop_sleep(client: BulletClient, clock: ClockCfg) -> PropSleep:
    """Return the sleep of the props of a world, if its clock has any.

    Args:
        client: The PyBullet client.
        clock: The clock of the world.
    """
    if math.isinf(clock.sleep_s):
        return NoSleep()
    return RestingProps(client, clock)


def _unknown_poses(count: int) -> tuple[Floats, Floats]:
    """Return positions and rotations that no pose is near to."""
    return np.full((count, 3), np.inf), np.full((count, 3, 3), np.inf)
