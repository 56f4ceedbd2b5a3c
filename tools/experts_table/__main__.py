"""Run the command as a module."""

import sys

from tools.experts_table.command import main

sys.exit(main())
