"""Run the zoo as a module."""

import sys

from veca_marl.zoo.command import main

sys.exit(main())
