"""Run the server as a module."""

import sys

from veca_marl.serve.command import main

sys.exit(main())
