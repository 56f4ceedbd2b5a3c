"""A plug-in of veca_marl: a task, an interaction, and presets of vision and of the walking body.

Importing this package registers the task FindBeacon and the verb `switch_off`. The presets
``senses/vision=short_sighted`` and ``body=walker_switch`` are files in the folder `conf` beside
this one, where Hydra finds them under the same groups as those of veca_marl.
"""

from veca_marl_beacon.find_beacon import FindBeacon
from veca_marl_beacon.switch_off import SwitchOff

__all__ = ["FindBeacon", "SwitchOff"]
