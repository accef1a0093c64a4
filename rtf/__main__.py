"""``python -m rtf``: the ``rtf`` command."""

import sys

from rtf.cli.tools import main

if __name__ == "__main__":
    sys.exit(main())
