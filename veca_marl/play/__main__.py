"""Run the player as a module."""

import sys

from veca_marl.play.command import main

sys.exit(main())
