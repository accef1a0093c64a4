"""``python -m rtf``: the ``rtf`` command."""

import sys

from rtf.cli.command_tree import rtf_main

if __name__ == "__main__":
    sys.exit(rtf_main())
