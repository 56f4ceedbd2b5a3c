"""Rules of the tasks that ship with the package.

Importing this package imports all its modules, and so registers the tasks that they define.
"""

from veca_marl.registry import import_modules

import_modules(__name__, __path__)
