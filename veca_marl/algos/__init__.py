"""Learning: knows specs and teams, never a task, never the simulator.

Importing it registers the algorithms that ship with the package.
"""

from veca_marl.algos import cloning, ppo, sac

__all__ = ["cloning", "ppo", "sac"]
