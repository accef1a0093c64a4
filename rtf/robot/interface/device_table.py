"""The devices of a running robot: opened in the order of the document, closed in reverse order."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtf.clock import Deadline
from rtf.robot.device import Device, find_device
from rtf.robot.errors import DeviceError
from rtf.robot.interface.device_thread import DeviceThread, Patience, StopRequests, Task, sentence_of
from rtf.robot.interface.log import Level, Log, seconds

if TYPE_CHECKING:
    from collections.abc import Callable

    from rtf.middleware.ports.network import Network
    from rtf.robot.interface.model import DeviceEntry, Robot


class DeviceTable:
    """The open devices. For one thread, except for ``devices``, which only grows while they are opened.

    ``failures`` are messages about devices that could not be opened or closed; ``hanging`` names calls that still hang.
    """

    def __init__(
        self, robot: Robot, network: Network | None, patience: Patience, stop_requests: StopRequests, log: Log
    ) -> None:
        self.devices: dict[str, Device] = {}
        self.failures: list[str] = []
        self._robot = robot
        self._network = network
        self._patience = patience
        self._stop_requests = stop_requests
        self._log = log
        self._threads = {entry.name: DeviceThread(entry.name) for entry in robot.devices}
        self._made: dict[str, Device] = {}
        self._closing: list[Task] = []

    @property
    def hanging(self) -> list[str]:
        """The names of calls that have not returned."""
        tasks = [*(thread.busy_with for thread in self._threads.values()), *self._closing]
        return [task.name for task in tasks if task is not None and not task.done]

    # Opening -----------------------------------------------------------------------------------------------------

    def open_all(self) -> bool:
        """Open every device, until a stop request; return whether all are open."""
        for number, entry in enumerate(self._robot.devices, 1):
            if self._stop_requests.count:
                break
            self._open(entry, f"{number}/{len(self._robot.devices)}")
        return len(self.devices) == len(self._robot.devices)

    def _open(self, entry: DeviceEntry, count: str) -> None:
        who = f"{entry.name} ({entry.kind})"

        def make() -> None:
            beside = Path(entry.location.file).parent if entry.location.file else None
            device = find_device(entry.kind, beside)(entry.name, network=self._network)
            self._made[entry.name] = device
            device.open(entry.configuration.copy())

        task = self._threads[entry.name].submit(Task(f"the opening of {who}", make, self._stop_requests))
        self.wait_for(task, self._patience.open)
        if not task.done:
            why = (
                f"hangs since {seconds(self._patience.open)}"
                if self._stop_requests.count < _CUT
                else "was not waited for"
            )
            self._fail(f"{entry.location}: the opening of {who} {why}")
        elif task.error is not None:
            self._made.pop(entry.name, None)  # a device whose open() failed holds no resources
            self._fail(f"{entry.location}: {who} cannot be opened: {sentence_of(task.error)}")
        else:
            self.devices[entry.name] = self._made[entry.name]
            self._log(Level.INFO, f"opened {who} in {seconds(task.duration)} [{count}]")

    # Calls -------------------------------------------------------------------------------------------------------

    def submit(self, name: str, what: str, job: Callable[[], object]) -> Task:
        """Run a call of a device in its thread. Raises DeviceError while an earlier call hangs."""
        busy = self._threads[name].busy_with
        if busy is not None:
            raise DeviceError(f"{busy.name} still hangs")
        return self._threads[name].submit(Task(what, job, self._stop_requests))

    def wait_for(self, task: Task, patience: float) -> None:
        """Wait until a task is done, or its time is up. From the second stop request on, each one cuts the wait short.

        Even then it gets a short time: a device that is not closed may leave a motor on.
        """
        heard = max(self._stop_requests.count, _CUT - 1)
        deadline = Deadline.after(patience)
        self._stop_requests.wait(lambda: task.done or self._stop_requests.count > heard, deadline)
        self._stop_requests.wait(lambda: task.done, deadline.earliest(Deadline.after(self._patience.hurry)))

    # Closing -----------------------------------------------------------------------------------------------------

    def close_all(self) -> None:
        """Close every device that was opened, or hangs in open, in reverse order. One that hangs delays no other."""
        for entry in reversed(self._robot.devices):
            device = self._made.pop(entry.name, None)
            if device is not None:
                self._close(entry, device)
        for thread in self._threads.values():
            thread.end()

    def _close(self, entry: DeviceEntry, device: Device) -> None:
        who = f"{entry.name} ({entry.kind})"
        task = Task(f"the closing of {who}", device.close, self._stop_requests)
        if self._threads[entry.name].busy_with is None:
            self._threads[entry.name].submit(task)
        else:  # its own thread hangs; close() is allowed in any state, and may end that
            self._closing.append(task.start())
        self.wait_for(task, self._patience.close)
        if not task.done:
            self._fail(f"{entry.location}: the closing of {who} hangs")
        elif task.error is not None:
            self._fail(f"{entry.location}: {who} cannot be closed: {sentence_of(task.error)}")
        else:
            self._log(Level.INFO, f"closed {who} in {seconds(task.duration)}")

    def _fail(self, sentence: str) -> None:
        self.failures.append(sentence)
        self._log(Level.ERROR, sentence)


#: The number of the stop request from which on long calls are not awaited.
_CUT = 2
