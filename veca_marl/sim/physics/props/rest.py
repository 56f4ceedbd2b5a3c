"""Props at rest, which Bullet leaves out of the simulation until something touches them.

Bullet puts bodies that touch each other to sleep together, once each of them may sleep, and wakes
them when a moving body comes near. What has no mass wakes nothing in Bullet: a walker wakes the
props within its reach, and so does the world where a fixed prop is put elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from veca_marl.sim.physics.bullet import pybullet

if TYPE_CHECKING:
    from veca_marl.sim.physics.props.prop import Prop

REST_SPEED = 0.01
"""Speed in m/s and rad/s below which a prop is at rest.

The default threshold of Unity and PhysX, 0.005 J per kg, is the kinetic energy at ten times this
speed.
"""

_SLEEP = pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP
_WAKE = pybullet.ACTIVATION_STATE_DISABLE_SLEEPING | pybullet.ACTIVATION_STATE_WAKE_UP
_OTHER_BODY = 2  # entry of PyBullet's contact points


class Rest(Protocol):
    """What a prop calls before it is moved, so that sleeping props notice."""

    def wake(self) -> None:
        """Wake the prop, before its velocity is set or its motor is started."""

    def wake_around(self) -> None:
        """Wake the prop and what it may have supported, before it is put elsewhere."""


class Awake:
    """The rest of a prop in a world in which nothing sleeps."""

    def wake(self) -> None:
        """Do nothing."""

    def wake_around(self) -> None:
        """Do nothing."""


class Sleep:
    """Whether Bullet may leave a movable prop out of the simulation.

    Args:
        prop: The prop.
        client: PyBullet's client id.
        steps: Agent steps at rest after which it sleeps.
        woken: The props that were woken since the last physics step; it is added when it wakes.
    """

    def __init__(self, prop: Prop, client: int, steps: int, woken: list[Prop]) -> None:
        self._prop = prop
        self._client = client
        self._steps = steps
        self._woken = woken
        self._still_steps = 0
        self._allowed = False
        # Bullet compares the sum of the squares of all velocities
        pybullet.changeDynamics(
            prop.body_id, -1, sleepThreshold=REST_SPEED**2, physicsClientId=client
        )

    def wake(self) -> None:
        """Let Bullet simulate the prop, from the second physics step on; the first does not."""
        self._still_steps = 0
        if self._allowed:
            self._allowed = False
            self._woken.append(self._prop)
            self._set_state(self._prop.body_id, _WAKE)

    def wake_around(self) -> None:
        """Wake the prop, and what touched it in the last physics step."""
        self.wake()
        points = pybullet.getContactPoints(self._prop.body_id, physicsClientId=self._client)
        for other in sorted({point[_OTHER_BODY] for point in points}):
            self._set_state(other, pybullet.ACTIVATION_STATE_WAKE_UP)

    def count(self, still: bool) -> None:
        """Count an agent step, and let the prop sleep when it has been at rest for long enough.

        Args:
            still: Whether the prop was at rest in it.
        """
        self._still_steps = self._still_steps + 1 if still else 0
        # and again later: a prop that touched it may have woken it since
        if self._still_steps and self._still_steps % self._steps == 0:
            self._allowed = True
            self._set_state(self._prop.body_id, _SLEEP)

    def _set_state(self, body_id: int, state: int) -> None:
        pybullet.changeDynamics(body_id, -1, activationState=state, physicsClientId=self._client)
