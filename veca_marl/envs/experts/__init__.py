"""Scripted policies of the tasks. Importing this package registers them; see `core.expert`.

One module per task or family of tasks lies here. `control`, `perception` and `skills` hold what
experts share. Tasks do not import this package.
"""

import veca_marl.envs.experts.blocks
import veca_marl.envs.experts.cars
import veca_marl.envs.experts.developmental
import veca_marl.envs.experts.escape
import veca_marl.envs.experts.grasping
import veca_marl.envs.experts.kick_the_ball
import veca_marl.envs.experts.maze_navigation
import veca_marl.envs.experts.motor_skills
import veca_marl.envs.experts.navigation
import veca_marl.envs.experts.object_navigation
import veca_marl.envs.experts.push_out
import veca_marl.envs.experts.rotate_cube
import veca_marl.envs.experts.soccer
import veca_marl.envs.experts.sorting  # noqa: F401
