"""What the benchmarks of both ROS measure: round trips of joint states, and what publishing a robot takes."""

from __future__ import annotations

import statistics
import threading
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

#: Joints of a round trip, and of each of the parts that are published.
JOINTS, OF_A_PART, PARTS = 53, 9, 6


def round_trips(node: Any, kind: Any, message: object, count: int) -> list[float]:
    """Milliseconds of round trips of a message, which another process sends back."""
    back = threading.Event()
    node.subscribe("back", kind, lambda _: back.set())
    there = node.publisher("there", kind)
    while not back.is_set():  # until both ends have found each other
        there.publish(message)
        back.wait(0.1)
    times = []
    for _ in range(count):
        back.clear()
        begun = time.perf_counter()
        there.publish(message)
        if back.wait(1.0):
            times.append(1e3 * (time.perf_counter() - begun))
    return times


def load(states: Any, cameras: list[Any], part: object, picture: Callable[[], object], seconds: float) -> float:
    """The share of a core that publishing six parts at 100 Hz, and pictures of cameras at 30 Hz, takes."""
    used, begun = time.process_time(), time.perf_counter()
    ticks = 0
    while time.perf_counter() - begun < seconds:
        for _ in range(PARTS):
            states.publish(part)
        if ticks % 10 in (0, 3, 6):
            for camera in cameras:
                camera.publish(picture())
        ticks += 1
        time.sleep(max(begun + 0.01 * ticks - time.perf_counter(), 0.0))
    return (time.process_time() - used) / (time.perf_counter() - begun)


def print_figures(what: str, times: list[float], count: int) -> None:
    """Print the figures of round trips."""
    ordered = sorted(times)
    print(
        f"JointState of {JOINTS} joints, round trip{what}: median {statistics.median(ordered):.2f} ms, "
        f"p95 {ordered[int(0.95 * len(ordered))]:.2f} ms, {len(ordered)} of {count}"
    )
