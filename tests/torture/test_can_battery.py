"""A share of the battery through CAN boards: the same verdicts as on the direct path. See :mod:`run_can_battery`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .run_can_battery import MISSING, Row, compare, of_part, table

if TYPE_CHECKING:
    from pathlib import Path

#: A test of a few seconds, with commands in all modes.
_QUICK = "references and not torque"


def test_a_part_has_the_same_verdicts_on_both_paths(tmp_path: Path):
    """Through control board, driver, bus and firmware the torso does what it does directly."""
    rows = compare("torso", tmp_path, _QUICK)
    (row,) = rows
    assert (row.test, row.direct, row.can) == ("references-torso", "passed", "passed"), "\n".join(table(rows))
    assert row.numbers > 20


def test_what_boards_cannot_do_is_left_out_by_name(tmp_path: Path):
    """A suite of one part has the tests of this part, and the parameters that leave out what is missing."""
    suite = tmp_path / "suite.xml"
    suite.write_text(
        """<suite name="some">
            <for name="part" in="head torso"> <test name="modes ${part}"> ControlModes </test> </for>
            <test name="whole"> Imu </test>
        </suite>""",
        encoding="utf-8",
    )
    made = of_part(suite, "torso").decode()
    assert 'in="torso"' in made
    assert "whole" not in made
    for _, parameter, value in MISSING:
        assert f'<parameter name="{parameter}">{value}</parameter>' in made


def test_differences_of_verdicts_are_shown():
    """With what the tests say."""
    (first, second) = table([Row("step-torso", "passed", "failed", 3, None, ("ripple is 0.2 Nm",))])
    assert "passed / failed" in first
    assert "ripple is 0.2 Nm" in second
