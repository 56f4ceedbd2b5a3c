"""A plug-in of veca_marl: the task FindBeacon and the preset ``senses/vision=short_sighted``.

Importing this package registers the task. The preset is a file in the folder `conf` beside this
one, where Hydra finds it under the same groups as those of veca_marl.
"""

from veca_marl_beacon.find_beacon import FindBeacon

__all__ = ["FindBeacon"]
