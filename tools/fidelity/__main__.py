"""Run the measurements as a module."""

import sys

from tools.fidelity.command import main

if __name__ == "__main__":  # the processes of the command import this module under another name
    sys.exit(main())
