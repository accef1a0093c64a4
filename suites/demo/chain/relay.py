"""A program of the application chain.xml: takes numbers at /chain/NAME:i, and gives each plus one at /chain/NAME:o.

The source counts by itself, twenty times a second. Every program prints one number a second, for the logs.
"""

import sys
import time
from contextlib import ExitStack

from rtf.bottle import Bottle
from rtf.middleware.ports.port import Port


def main(name: str) -> None:
    """Run until the process is ended."""
    number, printed = 0, 0.0
    with ExitStack() as opened:
        into = None if name == "source" else opened.enter_context(Port(f"/chain/{name}:i", outputs=False))
        out = opened.enter_context(Port(f"/chain/{name}:o", inputs=False))
        while True:
            if into is None:
                time.sleep(0.05)
                number += 1
            else:
                number = int(into.read()[0]) + 1
            out.write(Bottle([number]))
            if time.monotonic() >= printed + 1.0:
                printed = time.monotonic()
                print(f"{name} is at {number}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
