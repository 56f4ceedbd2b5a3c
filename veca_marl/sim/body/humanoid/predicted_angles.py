"""Predicted joint angles at the end of a step in which springs pull the joints to targets.

A torque command is constant for one agent step (40 ms). A proportional controller as stiff as the
joints are strong, evaluated with the angles at the start of the step, is unstable; evaluated with
the predicted angles at its end it is stable at any stiffness: "stable PD control", Tan, Liu & Turk
2011, IEEE Computer Graphics and Applications 31(4). The prediction contains weight and contact
forces: without them the stiffness at rest would be K / (1 + h K / D) instead of K, with stiffness
K, damping D and horizon h; that is a fourth of K for a horizon of one agent step.
"""

from __future__ import annotations

from veca_marl.sim.body.humanoid.articulation import Articulation
from veca_marl.sim.geometry import Floats


def predicted_angles(
    body: Articulation, targets: Floats, stiffness: Floats, horizon_s: float
) -> Floats:
    """Return the joint angles ``(82,)``, rad, after springs have acted.

    Weight and contact forces are those that are predicted for the next physics step.

    Args:
        body: The body, with the state of the last `read`.
        targets: ``(82,)`` rad, the rest angles of the springs.
        stiffness: ``(82,)`` N m/rad.
        horizon_s: Duration.
    """
    moving = body.moving
    spring, damping, speeds = stiffness[moving], body.damping[moving], body.speeds[moving]
    stretch = targets[moving] - body.angles[moving] - horizon_s * speeds
    forces = body.dynamics.forces.predicted - body.dynamics.state.bias
    forces[6:] += spring * stretch - damping * speeds
    resistance = horizon_s * damping + horizon_s**2 * spring
    accelerations = body.dynamics.solve_with(resistance, forces)[6:]
    angles = body.angles.copy()
    angles[moving] += horizon_s * speeds + horizon_s**2 * accelerations
    return angles
