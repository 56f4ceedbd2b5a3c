"""Run the command as a module."""

import sys

from veca_marl.demonstrations.command import main

sys.exit(main())
