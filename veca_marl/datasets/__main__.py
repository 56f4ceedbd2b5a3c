"""Run the commands on data sets as a module."""

import sys

from veca_marl.datasets.command import main

sys.exit(main())
