"""Scripted policies of the tasks. Importing this package registers them; see `core.expert`.

The expert of a task is in the package of the same name as that of the task in `envs.tasks`.
`control`, `perception` and `skills` contain what experts share. Tasks do not import this package.
"""

import veca_marl.envs.experts.babyzumas_revenge
import veca_marl.envs.experts.cars
import veca_marl.envs.experts.hand_regard
import veca_marl.envs.experts.kick_the_ball
import veca_marl.envs.experts.motor_skills
import veca_marl.envs.experts.multi_agent_nav
import veca_marl.envs.experts.navigation
import veca_marl.envs.experts.objects
import veca_marl.envs.experts.push_out
import veca_marl.envs.experts.self_touch
import veca_marl.envs.experts.soccer
import veca_marl.envs.experts.sorting  # noqa: F401
