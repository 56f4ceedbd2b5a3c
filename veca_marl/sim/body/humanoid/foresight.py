"""Where the joints will be at the end of a step in which springs pull them.

A torque that is given once per agent step (40 ms) holds for all of it. A spring as stiff as the
joints are strong, measured at the step's begin, shakes the body until it falls; measured at the
step's end it is stable at any stiffness: "stable PD", Tan, Liu & Turk 2011, IEEE Computer Graphics
and Applications 31(4).
"""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.humanoid.articulation import Articulation
from veca_marl.sim.geometry.pose import Floats


def foreseen_angles(
    body: Articulation, targets: Floats, stiffness: Floats, ahead_s: float
) -> Floats:
    """Return the joint angles ``(82,)``, rad, after a pull of springs, without contact and weight.

    Args:
        body: The body as it was last read.
        targets: ``(82,)`` rad, where the springs pull the joints to.
        stiffness: ``(82,)`` N m/rad.
        ahead_s: For how long they pull.
    """
    moving = body.moving
    spring, damping, speeds = stiffness[moving], body.damping[moving], body.speeds[moving]
    matrix = body.mass_matrix()
    torques = np.zeros(len(matrix))
    stretch = targets[moving] - body.angles[moving] - ahead_s * speeds
    torques[6:] = spring * stretch - damping * speeds
    resistance = np.zeros(len(matrix))
    resistance[6:] = ahead_s * damping + ahead_s**2 * spring
    accelerations = np.linalg.solve(matrix + np.diag(resistance), torques)[6:]
    angles = body.angles.copy()
    angles[moving] += ahead_s * speeds + ahead_s**2 * accelerations
    return angles
