"""Interface files: ``python tests/benchmarks/run_idl_benchmarks.py``.

A call of three scalars beside the same bottle by hand (1.25 times wanted), a structure of 53 doubles there and back
(60 us), a file of 500 lines (150 ms, by the processor). ``--fuzz N``: damaged files and replies give errors of ours.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import tempfile
import time
import timeit
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtf import idl
from rtf.bottle import Bottle, Dialect
from rtf.errors import RtfError
from rtf.idl.resolving import program_of
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient, RpcServer

if TYPE_CHECKING:
    from collections.abc import Callable

STATE = "struct State {{ {} }}".format(" ".join(f"{number + 1}: double q{number};" for number in range(53)))
ADDER = "service Adder { double add(1: double a, 2: i32 b, 3: string c) }"


def big_file(lines: int) -> str:
    """A file as YARP's devices have them: structures, and a service of many functions."""
    parts = [
        f"/** Number {n}. */\nstruct Answer{n} {{\n  1: bool ok;\n  2: list<double> values = [1.0];\n}}\n"
        for n in range(lines // 10)
    ]
    calls = [f"  /** Asks. */\n  Answer{n} ask{n}(1: i32 joint, 2: string name = 'x');" for n in range(lines // 10)]
    filler = "\n".join(f"const i32 C{n} = {n}" for n in range(lines - 7 * (lines // 10)))
    return "".join(parts) + "service Many {\n" + "\n".join(calls) + "\n}\n" + filler


def load(path: Path) -> Any:
    """Seconds of processor for a file, at best."""
    times = []
    for _ in range(7):
        begun = time.process_time()
        idl.load(path)
        times.append(time.process_time() - begun)
    return min(times)


_BLOCK = 200


def times(call: Callable[[], object]) -> list[float]:
    """The seconds of a block of calls, each."""
    found = []
    for _ in range(_BLOCK):
        begun = time.perf_counter()
        call()
        found.append(time.perf_counter() - begun)
    return found


def calls(adder: Any, count: int) -> tuple[float, float]:
    """Microseconds of a call, typed and by hand, in blocks in turn."""

    class Server(adder.Adder):  # type: ignore[name-defined,misc]
        def add(self, a: float, b: int, c: str) -> float:
            return a + b

    network = Network(LocalNames())
    with (
        idl.serve("/typed", Server(), network=network),
        RpcServer("/plain", lambda request: Bottle([request[1] + request[2]]), network=network),
        adder.AdderClient("/one", "/typed", network=network) as client,
        RpcClient("/other", "/plain", network=network) as other,
    ):
        request = Bottle(["add", 1.0, 2, "text"])
        typed: list[float] = []
        plain: list[float] = []
        for _ in range(count // _BLOCK):  # in blocks: a call right after another one finds all threads awake
            typed += times(lambda: client.add(1.0, 2, "text"))
            plain += times(lambda: other.call(request))
    return 1e6 * statistics.median(typed), 1e6 * statistics.median(plain)


def fuzz(module: Any, text: str, count: int) -> tuple[int, int]:
    """How many of damaged files and messages were taken; errors that are not ours are raised."""
    numbers = random.Random(1)
    codec = module.State.codec
    good = b"".join(codec.encode(module.State(), Dialect.YARP3))
    files = messages = 0
    for _ in range(count):
        at = numbers.randrange(len(text))
        damaged = (
            text[:at]
            + numbers.choice(["", "{", "}", "<", "\0", "é", "struct", "/*", '"'])
            + text[at + numbers.randrange(9) :]
        )
        data = bytearray(good[: numbers.randrange(1, len(good) + 1)])
        data[numbers.randrange(len(data))] = numbers.randrange(256)
        try:
            program_of(damaged)
            files += 1
        except RtfError:
            pass
        try:
            codec.decode(bytes(data), Dialect.YARP3)
            messages += 1
        except RtfError:
            pass
    return files, messages


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--fuzz", type=int, default=0, metavar="N")
    options = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # else the kernel's choice of cores decides on the calls
    print(f"load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "state.thrift"
        path.write_text(f"{STATE}\n{ADDER}")
        module = idl.load(path)
        many = Path(name) / "many.thrift"
        many.write_text(big_file(500))
        print(f"{len(many.read_text().splitlines())} lines: {1e3 * load(many):.0f} ms of the processor")
        state = module.State(*map(float, range(53)))
        data = b"".join(module.State.codec.encode(state, Dialect.YARP3))
        encode = (
            min(timeit.repeat(lambda: module.State.codec.encode(state, Dialect.YARP3), number=500, repeat=15)) / 500
        )
        decode = min(timeit.repeat(lambda: module.State.codec.decode(data, Dialect.YARP3), number=500, repeat=15)) / 500
        print(f"53 doubles: encoded in {1e6 * encode:.1f} us, decoded in {1e6 * decode:.1f} us")
        typed, plain = calls(module, options.calls)
        print(f"call of three scalars: {typed:.0f} us, by hand {plain:.0f} us, {typed / plain:.2f} times")
        if options.fuzz:
            files, messages = fuzz(module, path.read_text(), options.fuzz)
            print(f"{options.fuzz} damaged files and messages: {files} and {messages} could be read, others are errors")


if __name__ == "__main__":
    main()
