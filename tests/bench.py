"""Plug-ins and suites in which everything happens that a page has to show; written into a folder and run for real.

Tests that stand at a *gate* go on when the file of that name is in the folder of the suite, so that whoever looks on
decides what happens when.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_GATE = """
import os
from pathlib import Path
from rtf import clock
from rtf.testing import TestCase

def wait_for(name):
    while not Path(__file__).with_name(name).exists():
        clock.sleep(0.01)
"""

MEASURE = (
    _GATE
    + """
import math

class Measure(TestCase):
    '''Moves joints, one of them badly.'''

    def run(self):
        axis = [index / 500 for index in range(2000)]
        self.report("three joints move")
        for joint, error in ((1, 0.1), (2, 0.95), (3, 1.4)):
            with self.subresult(f"joint {joint}"):
                wanted = [10 * math.sin(t) for t in axis]
                reached = [10 * math.sin(t) + error * math.cos(9 * t) for t in axis]
                self.record("track", t=(axis, "s"), reference=(wanted, "deg"), measured=(reached, "deg"))
                self.measure("tracking error", error, "deg", low=-1, high=1, marginal=0.1)
        self.attach(Path(__file__).with_name("arm.png"))
        self.attach(b"the last words of the arm\\n", "words.txt")
"""
)

CRASH = """
import os, sys
from rtf.testing import TestCase

class Crash(TestCase):
    def run(self):
        print("about to fall", flush=True)
        os.abort()
"""

HANG = """
from rtf import clock
from rtf.testing import TestCase

class Hang(TestCase):
    def run(self):
        clock.sleep(600)
"""

SERVER = """
import os, sys, time
from pathlib import Path

die, died = (Path(__file__).with_name(name) for name in ("die", "died"))
print("ready to serve", flush=True)
while not die.exists() or died.exists():
    time.sleep(0.01)
died.touch()
print("cannot bear it", file=sys.stderr, flush=True)
os.abort()
"""

COLLAPSE = (
    _GATE
    + """
class Collapse(TestCase):
    '''Has its server die under it, once.'''

    def run(self):
        Path(__file__).with_name("die").touch()
        if not Path(__file__).with_name("again").exists():
            Path(__file__).with_name("again").touch()
            clock.sleep(600)
        self.check(True, "the server serves")
"""
)

FLAKY = """
from pathlib import Path
from rtf.testing import TestCase

class Flaky(TestCase):
    def run(self):
        mark = Path(__file__).with_name("tried")
        first = not mark.exists()
        mark.touch()
        self.check(not first, "the second time is better")
"""

ASK = """
from pathlib import Path
from rtf.testing import TestCase

class Ask(TestCase):
    def run(self):
        picture = str(Path(__file__).with_name("arm.png"))
        sure = self.confirm("Is the lamp green?", picture=picture, default=True)
        colour = self.ask("Which colour has the lamp?", ["red", "green", "blue"], default="green")
        name = self.ask("Who is asking?", default="nobody")
        weight = self.ask_number("How heavy is the arm?", "kg", default=2.5)
        self.report(f"answers: {sure} {colour} {name} {weight}")
"""

SKIP = """
from rtf.testing import TestCase

class Skip(TestCase):
    def run(self):
        self.skip("no camera here")
"""

GATE = (
    _GATE
    + """
class Gate(TestCase):
    '''Says something, waits to be let on, says something else.'''

    def run(self):
        self.report("before the gate")
        wait_for("go")
        self.report("behind the gate")
"""
)

GROW = (
    _GATE
    + """
class Grow(TestCase):
    '''Records a series row by row, and closes it when it is let on.'''

    def run(self):
        with self.series("ramp", t="s", position="deg") as ramp:
            for index in range(400):
                ramp.append(index / 100, index % 50)
                clock.sleep(0.002)
            wait_for("grown")
"""
)

SAY = (
    _GATE
    + """
class Say(TestCase):
    '''Says a line for each file that says so, until there is one called "enough".'''

    def run(self):
        count = 0
        here = Path(__file__).parent
        while not (here / "enough").exists():
            while not (here / f"say{count + 1}").exists() and not (here / "enough").exists():
                clock.sleep(0.01)
            if (here / f"say{count + 1}").exists():
                count += 1
                self.report(f"line {count}")
                self.measure(f"quantity {count}", count, "V", low=0, high=100)
"""
)


def png(width: int = 48, height: int = 32, colour: tuple[int, int, int] = (0, 102, 74)) -> bytes:
    """Return a picture of one colour."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + bytes(colour) * width) * height
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


#: What everything runs on, and everything that can become of a test.
BENCH = """
<description>Everything that can become of a test</description>
<timeout setup="10" teardown="5">20</timeout>
<fixture name="server" backoff="0.05" check-period="0.05">
  <parameter name="command">python3 server.py</parameter>
  <parameter name="directory">.</parameter>
  <parameter name="ready_log">ready to serve</parameter>
  process
</fixture>
<test name="measure" fixtures="">measure.py</test>
<test name="crash" fixtures="">crash.py</test>
<test name="hang" fixtures="" timeout="0.5">hang.py</test>
<test name="collapse" fixtures="server">collapse.py</test>
<test name="flaky" fixtures="" retries="2">flaky.py</test>
<test name="ask" fixtures="">ask.py</test>
<test name="skip" fixtures="">skip.py</test>
"""
FILES = {
    "measure.py": MEASURE,
    "crash.py": CRASH,
    "hang.py": HANG,
    "server.py": SERVER,
    "collapse.py": COLLAPSE,
    "flaky.py": FLAKY,
    "ask.py": ASK,
    "skip.py": SKIP,
    "gate.py": GATE,
    "grow.py": GROW,
    "say.py": SAY,
}


def write(folder: Path, suite: str = BENCH, name: str = "bench") -> Path:
    """Write a suite and all plug-ins into a folder; returns the suite's file."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in FILES.items():
        (folder / file).write_text(text, encoding="utf-8")
    (folder / "arm.png").write_bytes(png())
    path = folder / "suite.xml"
    path.write_text(f'<suite name="{name}">{suite}</suite>', encoding="utf-8")
    return path
