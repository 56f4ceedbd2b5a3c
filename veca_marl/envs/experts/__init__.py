"""Scripted policies of the tasks. Importing this package registers them; see `core.expert`.

The expert of a task is in the module of the same name as the task's module or family in
`envs.tasks`, that of a task of `locomotion` in `motor_skills`. `control` contains what experts
share. Tasks do not import this package.
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
