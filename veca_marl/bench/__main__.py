"""Run the benchmark as a module."""

import sys

from veca_marl.bench.command import main

sys.exit(main())
