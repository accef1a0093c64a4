"""What it takes to write and read messages, without any network: ``python tests/benchmarks/run_codec_benchmarks.py``.

Each row is timed many times over; the best time is what the code takes, the median what it took on this machine now.
"""

from __future__ import annotations

import argparse
import statistics
import timeit
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtf.bottle import Bottle, Dialect
from rtf.bottle.binary import extent
from rtf.middleware.types import IMAGE, MATRIX, VECTOR, Image, Pair, PairCodec, Stamp
from rtf.middleware.types.codecs import BOTTLE, TextCodec, codec_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.types.codecs import Codec

DIALECT = Dialect.YARP3
MIXED = (
    '1 2.5 hello "two words" (1 2 3) [pos] {10 20 30} -7 "say" (1.5 2.5) (a (b c) [ok]) true 3000000000'  # one of each
)


class Row(NamedTuple):
    """One line of the table; ``goal`` in microseconds, 0 for none."""

    name: str
    run: Callable[[], object]
    goal: float = 0.0


def both(name: str, codec: Codec[object], value: object, write: float = 0.0, read: float = 0.0) -> Iterator[Row]:
    """Writing an object, and reading it from the buffer of a connection."""
    data = memoryview(bytearray(b"".join(codec.encode(value, DIALECT))))
    yield Row(f"{name}: write", lambda: codec.encode(value, DIALECT), write)
    yield Row(f"{name}: read", lambda: codec.decode(data, DIALECT), read)
    if type(codec).adopt is not TextCodec.adopt and len(data) > 1 << 16:
        yield Row(f"{name}: read without a copy", lambda: codec.adopt(data, DIALECT))


def rows() -> Iterator[Row]:
    """Everything that is timed."""
    position = Bottle.parse("[set] [pos] 0 10.0")
    yield from both("[set] [pos] 0 10.0", BOTTLE, position, 1.5, 2.5)
    data = b"".join(BOTTLE.encode(position, DIALECT))
    yield Row("[set] [pos] 0 10.0: its end", lambda: extent(data))
    yield from both("[is] [axes] 2 [tsta] 0 1.5 [ok]", BOTTLE, Bottle.parse("[is] [axes] 2 [tsta] 0 1.5 [ok]"))
    yield from both("a bottle of 13 kinds of things", BOTTLE, Bottle.parse(MIXED))
    yield from both("a bottle of a blob of 921600 bytes", BOTTLE, Bottle([bytes(921_600)]))
    vector = np.linspace(0, 1, 53)
    data53 = b"".join(VECTOR.encode(vector, DIALECT))
    yield from both("53 doubles", VECTOR, vector)
    yield Row(
        "53 doubles: write and read", lambda: (VECTOR.encode(vector, DIALECT), VECTOR.decode(data53, DIALECT)), 5.0
    )
    yield Row("53 doubles: which codec", lambda: codec_of(vector))
    yield from both("a matrix of 4 x 4", MATRIX, np.eye(4))
    yield from both("a command and 16 doubles", PairCodec(BOTTLE, VECTOR), Pair(Bottle.parse("[dpos]"), np.zeros(16)))
    image = Image(np.zeros((480, 640, 3), np.uint8))
    yield from both("an image of 640 x 480 rgb", IMAGE, image)
    for code in ("mono", "bgr", "hsv"):
        yield Row(f"an image of 640 x 480 rgb: to {code}", lambda code=code: image.to(code))
    stamp = Stamp(213, 1795210389.10542)
    yield Row("an envelope: write", lambda: str(stamp))
    yield Row("an envelope: read", lambda: Stamp.parse("213 1795210389.10542"))


def measure(run: Callable[[], object], seconds: float, repeat: int) -> list[float]:
    """Microseconds a call, several times; each time lasts about as long as is said."""
    timer = timeit.Timer(run)
    count = max(1, int(seconds / max(min(timer.repeat(3, 1)), 1e-7)))
    return [taken / count * 1e6 for taken in timer.repeat(repeat, count)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time codecs.")
    parser.add_argument("--seconds", type=float, default=0.002, help="how long each time lasts")
    parser.add_argument("--repeat", type=int, default=100, help="how many times each row is timed")
    options = parser.parse_args()
    print(f"{'':44}{'best':>10}{'median':>10}   goal")
    for row in rows():
        times = measure(row.run, options.seconds, options.repeat)
        goal = f"   {row.goal:g}" if row.goal else ""
        print(f"{row.name:44}{min(times):8.2f} us{statistics.median(times):7.2f} us{goal}")


if __name__ == "__main__":
    main()
