"""Run the command as a module."""

import sys

from tools.performance.command import main

if __name__ == "__main__":  # processes that roll out import this module under another name
    sys.exit(main())
