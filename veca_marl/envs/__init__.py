"""Games in worlds, and their adapters for TorchRL, Gymnasium and PettingZoo.

Importing this package registers the tasks that ship with it and their scripted experts.
"""

import veca_marl.envs.experts
import veca_marl.envs.tasks  # noqa: F401
