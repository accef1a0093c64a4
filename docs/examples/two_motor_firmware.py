"""A board with two motors at a pseudo terminal, to try the driver of ``serial_board.py`` without hardware.

It prints the name of its terminal and runs until its input ends. Lines of the input script it: ``fault 0 3`` (motor 0
reports fault 3), ``mute``, ``speak``. Time passes by 20 ms with each reading of the measurements, so that it does not
depend on the machine.
"""

from __future__ import annotations

import os
import pty
import selectors
import sys
import tty

STEP = 0.02
#: The current (A) that overcomes friction, and the speed that an ampere more gives (deg/s).
FRICTION, SPEED = 0.8, 100.0
#: The current at full duty cycle (A), and the mechanical stops (deg).
FULL, STOP = 10.0, 40.0


class Motor:
    """A motor that is where it shall be at once, or turns by the current that overcomes friction."""

    def __init__(self) -> None:
        self.position = self.velocity = self.current = self.duty = 0.0
        self.mode, self.value, self.fault = "O", 0.0, 0

    def take(self, mode: str, value: float) -> None:
        """Take a setpoint."""
        self.mode, self.value = mode, value
        if mode == "O":
            self.fault = 0

    def step(self) -> None:
        """Let time pass."""
        mode = "O" if self.fault else self.mode
        self.duty = self.value if mode == "D" else 0.0
        self.current = self.value if mode == "C" else FULL * self.duty / 100
        surplus = max(0.0, abs(self.current) - FRICTION) * (1 if self.current > 0 else -1)
        target = self.value if mode == "P" else self.position + SPEED * surplus * STEP
        target = min(max(target, -STOP), STOP)
        self.velocity = (target - self.position) / STEP
        self.position = target

    def __str__(self) -> str:
        numbers = (self.position, self.velocity, self.current, self.duty, 30.0)
        return " ".join(f"{number:.4f}" for number in numbers) + f" {self.fault}"


class Board:
    """The two motors, and the answers to lines."""

    def __init__(self) -> None:
        self.motors = (Motor(), Motor())
        self.mute = False

    def answer(self, line: str) -> str | None:
        """Execute a line of the host; return the answer, if there is one."""
        verb, *words = line.split() or [""]
        if verb == "I":
            self.motors = (Motor(), Motor())
            return "TWO-MOTOR-BOARD 1.0"
        if verb == "C":
            return "OK"
        if verb == "R":
            for motor in self.motors:
                motor.step()
            return " ".join(map(str, self.motors))
        if verb == "S":
            for motor, mode, value in zip(self.motors, words[::2], words[1::2], strict=True):
                motor.take(mode, float(value))
            return None
        return f"?{line}"

    def obey(self, line: str) -> None:
        """Execute a line of the script."""
        verb, *words = line.split()
        if verb == "fault":
            self.motors[int(words[0])].fault = int(words[1])
        else:
            self.mute = verb == "mute"


def main() -> None:
    """Serve until the input ends."""
    master, terminal = pty.openpty()
    tty.setraw(terminal)
    print(os.ttyname(terminal), flush=True)
    board, left = Board(), {master: b"", 0: b""}
    with selectors.DefaultSelector() as selector:
        for descriptor in left:
            selector.register(descriptor, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                data = os.read(key.fd, 4096)
                if not data:
                    sys.exit()
                *lines, left[key.fd] = (left[key.fd] + data).split(b"\n")
                for line in lines:
                    if key.fd != master:
                        board.obey(line.decode())
                        print("done", flush=True)
                        continue
                    answer = board.answer(line.decode())
                    if answer is not None and not board.mute:
                        os.write(master, f"{answer}\n".encode())


if __name__ == "__main__":
    main()
