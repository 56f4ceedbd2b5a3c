"""Run the command as a module."""

import sys

from veca_marl.experts_table.command import main

sys.exit(main())
