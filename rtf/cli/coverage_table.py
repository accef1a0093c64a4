"""The table of joints by tests of ``rtf robot check`` and ``rtf robot test``."""

from __future__ import annotations

from itertools import groupby
from string import ascii_letters
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.robot.model import RobotModel
    from rtf.robot_testing.coverage import Check


def print_coverage(robot: RobotModel, checks: Sequence[Check]) -> None:
    """Print which test judges which joint and sensor, and what no test does.

    Joints of a part that the same tests judge have one row.
    """
    from rtf.robot_testing.coverage import untouched

    marks = dict(zip(ascii_letters, checks, strict=False))
    for letter, check in marks.items():
        print(f"{letter}  {check.test}")
    rows = [(part, axis.name) for part in robot.served for axis in robot.part(part).axes]
    rows += [("sensors", key.removeprefix("sensors.")) for key in robot.sensor_keys]

    def judged(row: tuple[str, str]) -> tuple[str, str]:
        key = f"sensors.{row[1]}" if row[0] == "sensors" else row[1]
        return row[0], "".join(letter if key in check.subjects else "." for letter, check in marks.items())

    widest = max(len(part) for part, _ in rows)
    for (part, letters), members in groupby(rows, judged):
        print(f"{letters}  {part:<{widest}}  {', '.join(name for _, name in members)}")
    if missing := untouched(robot, checks):
        print(f"judged by no test: {', '.join(missing)}")
