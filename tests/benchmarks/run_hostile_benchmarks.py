"""What hostile callers cost a process with ports: ``python tests/benchmarks/run_hostile_benchmarks.py``.

Two hundred connections stay silent while thousands of damaged conversations, of every carrier, come and go. Printed
are the memory that the process has gained, and whether all threads and descriptors came back.
"""

from __future__ import annotations

import argparse
import os
import random
import socket
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.bottle import Bottle
from rtf.bottle.binary import encode
from rtf.middleware.wire import framing

if TYPE_CHECKING:
    from collections.abc import Iterator

#: The most that the process may gain, MiB, and the seconds after which all is to be back.
BOUND = 16.0
SILENT = 200
_WAIT = 10.0
#: Settings of the C library by which freed memory is given back at once, so that only what is held is measured. Without
#: them a process keeps some 100 MiB for its next buffers.
_GIVES_BACK = {"MALLOC_ARENA_MAX": "1", "MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
_SERVER = """
import os, sys, threading
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcServer
from waiting import eventually, open_descriptors

def memory():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmRSS")) / 1024

with NameServer() as server:
    network = Network(server.names)
    with BufferedPort("/stream:i", network=network) as stream, RpcServer("/rpc:i", list, network=network) as rpc:
        print(server.contact.port, stream.contact.port, rpc.contact.port, flush=True)

        def unended():
            # connections of datagrams, whose end cannot be seen: a thread and a socket each
            return sum(one.connectionless for port in (server._port, stream, rpc) for one in port.inputs)

        for line in sys.stdin:
            if line == "begin\\n":
                before = memory(), threading.active_count(), open_descriptors()
            else:
                limit = float(line)
                eventually(lambda: threading.active_count() <= before[1] + unended(), "a thread is left", limit)
                eventually(lambda: open_descriptors() <= before[2] + unended(), "a descriptor is left", limit)
                print(memory() - before[0], unended(), flush=True)
"""


@dataclass
class Outcome:
    """MiB gained by the process, connections of datagrams that stay, and the number of conversations."""

    gained: float
    unended: int
    conversations: int

    def line(self) -> str:
        """Return the outcome as it is printed."""
        return (
            f"{self.conversations} damaged conversations beside {SILENT} silent connections: {self.gained:.1f} MiB"
            f" gained (bound {BOUND:g}); all threads and descriptors came back but those of {self.unended} connections"
            " of datagrams, whose end cannot be seen"
        )


def conversations() -> list[bytes]:
    """Return a beginning of each kind of conversation, undamaged."""
    data = encode(Bottle(["set", 1.5, [1, 2, 3], "text"]))
    command = framing.command("d", "12 1.5")
    message = framing.index(len(command), len(data)) + command + data
    binary = [framing.header(number) + framing.sender("/hostile") + message for number in (131, 3, 0)]
    group = framing.header(1) + framing.sender("/hostile") + struct.pack(">4sH", bytes([224, 2, 1, 1]), 10_100)
    return [
        *binary,
        group,
        framing.header(131) + framing.sender("/hostile (recv priority) (tc 1) ((ex (/other -5)))") + message,
        b"HUMANITY/hostile (recv priority) (st 5)\r\nhuman says d\r\nset 1.5\r\n",
        b"CONNECT hostile\r\nd\r\nset 1.5 (1 2 3)\r\n*\r\n?\r\na\r\n[list] [in]\r\nq\r\n",
        b"CONNACK hostile\r\nd\r\nset 1.5\r\na\r\n[prop] [get] /rpc:i\r\nq\r\n",
        b"NAME_SERVER register /hostile/x tcp 127.0.0.1 1\r\nNAME_SERVER list\r\nNAME_SERVER unregister /hostile/x\r\n",
        b"UNIX_STR" + framing.sender("/hostile"),
        b"LOCALITY" + framing.sender("/hostile"),
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"POST /rpc HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\ntext=stop",
        b"GET /?action=stream HTTP/1.1\r\n\r\n",
    ]


def damaged(seed: int) -> Iterator[bytes]:
    """Return conversations with bytes changed, removed, repeated or cut off, without an end."""
    luck, whole = random.Random(seed), conversations()
    while True:
        data = bytearray(luck.choice(whole))
        for _ in range(luck.randrange(1, 6)):
            place = luck.randrange(len(data))
            kind = luck.randrange(4)
            if kind == 0:
                data[place] = luck.randrange(256)
            elif kind == 1:
                del data[place : place + luck.randrange(1, 9)]
            elif kind == 2:
                data[place:place] = data[place : place + luck.randrange(1, 65)] * luck.randrange(1, 9)
            else:
                data[place : place + 4] = luck.choice([b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\0\0\0\x80"])
            data = data or bytearray(b"\0")
        yield bytes(data)


def measure(count: int, seed: int = 1) -> Outcome:
    """Talk to a process with a name server and two ports. Raises CalledProcessError if something is left."""
    server = subprocess.Popen(
        [sys.executable, "-c", _SERVER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        env={**os.environ, **_GIVES_BACK, "PYTHONPATH": str(Path(__file__).parents[1])},
    )
    assert server.stdin is not None
    assert server.stdout is not None
    ports = [int(word) for word in server.stdout.readline().split()]
    source = damaged(seed)
    _talk(ports[0], next(source))  # what is loaded at the first conversation is no cost of the others
    for data in conversations():
        for port in ports:
            _talk(port, data)
    server.stdin.write("begin\n")
    silent = [socket.create_connection(("127.0.0.1", ports[number % 3])) for number in range(SILENT)]
    for number in range(count):
        _talk(ports[number % 3], next(source))
    for connection in silent:
        connection.close()
    server.stdin.write(f"{_WAIT}\n")
    answer = server.stdout.readline()
    server.stdin.close()
    code = server.wait()
    if code or not answer:
        raise subprocess.CalledProcessError(code, "the process with ports")
    gained, unended = answer.split()
    return Outcome(float(gained), int(unended), count)


def _talk(port: int, data: bytes) -> None:
    """Send a conversation and read what comes, at most until the end that follows ours."""
    with socket.create_connection(("127.0.0.1", port)) as peer:
        peer.settimeout(1.0)
        try:
            peer.sendall(data)
            peer.shutdown(socket.SHUT_WR)
            while peer.recv(1 << 16):
                pass
        except OSError:
            return  # cut off, as it may be


def main() -> None:
    """Print the outcome; exit with 1 if it is above the bound."""
    parser = argparse.ArgumentParser(description="What hostile callers cost a process with ports.")
    parser.add_argument("--conversations", type=int, default=6000)
    outcome = measure(parser.parse_args().conversations)
    print(outcome.line())
    sys.exit(outcome.gained > BOUND)


if __name__ == "__main__":
    main()
