"""The data sets: the paper's five and three of ours; the modules register what they define."""

from veca_marl.registry import import_modules

import_modules(__name__, __path__)
