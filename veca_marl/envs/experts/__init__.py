"""Scripted policies of the tasks. Importing this package registers them; see `core.expert`.

The expert of a task is in the package of the same name as that of the task in `envs.tasks`.
`control`, `perception` and `skills` contain what experts share. Tasks do not import this package.
"""

import veca_marl.envs.experts.babyzumas_revenge
import veca_marl.envs.experts.cars.chase_car
import veca_marl.envs.experts.cars.dodge_car
import veca_marl.envs.experts.contests.push_out
import veca_marl.envs.experts.contests.soccer
import veca_marl.envs.experts.hand_regard
import veca_marl.envs.experts.kick_the_ball
import veca_marl.envs.experts.motor_skills
import veca_marl.envs.experts.navigation.maze_nav
import veca_marl.envs.experts.navigation.multi_agent_nav
import veca_marl.envs.experts.navigation.object_nav
import veca_marl.envs.experts.objects.grab_object
import veca_marl.envs.experts.objects.move_to_target
import veca_marl.envs.experts.objects.pile_up_block
import veca_marl.envs.experts.objects.put_down_block
import veca_marl.envs.experts.objects.rotate_cube
import veca_marl.envs.experts.self_touch
import veca_marl.envs.experts.sorting.fill_fraction
import veca_marl.envs.experts.sorting.sorting_task  # noqa: F401
