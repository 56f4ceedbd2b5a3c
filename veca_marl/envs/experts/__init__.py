"""Scripted policies of the tasks; see `core.expert`.

Importing this package imports all its modules, and so registers the experts that they define.

The expert of a task is in the module of the same name as the task's module or family in
`envs.tasks`, that of a task of `locomotion` in `motor_skills`. `control` contains what experts
share. Tasks do not import this package.
"""

from veca_marl.registry import import_modules

import_modules(__name__, __path__)
