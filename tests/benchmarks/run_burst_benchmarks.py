"""Count what arrives of a burst by datagrams: ``python tests/benchmarks/run_burst_benchmarks.py``.

One program sends short lines as fast as it can, another one prints what it receives. Every pair is tried of ``rtf`` and
of ``yarp`` if that is on PATH, so the numbers of one run can be compared. Datagrams have no flow control: a reader that
is too slow for the kernel's buffer loses some.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rtf import clock
from rtf.middleware.naming.configuration import write_place
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import Network
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The text of a message, whose bottle has about 64 bytes.
_TEXT = "x" * 40
#: Seconds without a new message after which no more are expected, and seconds that a program may take to start.
_QUIET = 1.0
_STARTING = 20.0


def programs() -> dict[str, list[str]]:
    """Return the commands that can be compared, by name."""
    ours = {"rtf": [str(Path(sys.executable).with_name("rtf"))]}
    return {**ours, "yarp": ["yarp"]} if shutil.which("yarp") else ours


@contextmanager
def started(command: list[str], output: Path, network: Network, port: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program that opens a port, and wait for the port."""
    with (
        output.open("wb") as file,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=file, stderr=subprocess.DEVNULL) as process,
    ):
        try:
            deadline = clock.Deadline.after(_STARTING)
            while not remote.exists(network, Contact(port)):
                if process.poll() is not None or deadline.expired:
                    raise SystemExit(f"{' '.join(command)} did not open {port}")
                clock.sleep(0.05)
            yield process
        finally:
            process.kill()


def received(writer: list[str], reader: list[str], carrier: str, count: int, folder: Path, network: Network) -> int:
    """Return how many of ``count`` lines arrive that one program sends to another."""
    output = folder / "received"
    with (
        started([*reader, "read", "/burst/reader"], output, network, "/burst/reader"),
        started([*writer, "write", "/burst/writer"], folder / "sent", network, "/burst/writer") as sending,
    ):
        remote.connect(network, Contact("/burst/writer"), Contact("/burst/reader"), carrier)
        lines = "".join(f"{_TEXT} {number}\n" for number in range(count))
        assert sending.stdin is not None
        sending.stdin.write(lines.encode())
        sending.stdin.flush()
        size, changed = 0, clock.monotonic()
        while clock.monotonic() - changed < _QUIET or not size:
            clock.sleep(0.05)
            if (now := output.stat().st_size) != size:
                size, changed = now, clock.monotonic()
            elif clock.monotonic() - changed > _STARTING:
                break
    return output.read_text(encoding="utf-8").count(_TEXT)


def main() -> None:
    """Print a line for each carrier and pair of programs."""
    parser = argparse.ArgumentParser(description="Count the messages that arrive of bursts by udp and mcast.")
    parser.add_argument("--messages", type=int, default=3000, help="messages of a burst")
    count = parser.parse_args().messages
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rtf-benchmark-")))
        os.environ["YARP_CONFIG_HOME"] = str(folder / "yarp")
        server = stack.enter_context(NameServer())
        write_place(server.contact)
        network = Network(server.names)
        print(f"bursts of {count} messages, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors", flush=True)
        for carrier in ("udp", "mcast"):
            for writer, writing in programs().items():
                for reader, reading in programs().items():
                    arrived = received(writing, reading, carrier, count, folder, network)
                    print(f"  {carrier:6}{writer:>5} to {reader:5}{arrived:6} of {count} arrived", flush=True)


if __name__ == "__main__":
    main()
