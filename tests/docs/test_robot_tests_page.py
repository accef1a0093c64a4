"""The table of the page on robot tests is that of the tests."""

from __future__ import annotations

from pathlib import Path

from robot_test_catalogue import Entry, as_markdown, entries, with_table

from rtf.robot_testing import Safety

ROOT = Path(__file__).parents[2]


def test_the_table_is_current():
    """It is the output of python tools/robot_test_catalogue.py docs/robot-tests.md."""
    page = (ROOT / "docs" / "robot-tests.md").read_text(encoding="utf-8")
    assert with_table(page, as_markdown(entries())) == page


def test_the_table_is_complete():
    """Each file has a row with its test, under a name of its own, and a description."""
    found = entries()
    assert len(found) == len([*(ROOT / "icub_tests").glob("*.py")])
    names = [name for one in found for name in (one.name, *one.aliases)]
    assert sorted(names) == sorted(set(names))
    assert all(one.purpose.endswith(".") for one in found)


def test_every_test_is_in_a_suite():
    """Each test is in one of the shipped suites."""
    assert [one.name for one in entries() if one.suite == "in no suite"] == []


def test_the_safety_is_what_a_run_obeys():
    """Inherited values count, too."""
    by_name = {one.name: one.safety for one in entries()}
    assert by_name["JointLimits"] is Safety.MOTION
    assert by_name["MotorEncodersSignCheck"] is Safety.EFFORT  # from its base
    assert by_name["PortsFrequency"] is Safety.STILL


def test_a_table_has_a_row_a_test():
    """Suites are headings; names are code."""
    table = as_markdown(
        [Entry("A", ("a",), Safety.STILL, "Looks.", "eyes"), Entry("B", (), Safety.FAULT, "Acts.", "arms")]
    )
    assert "### Eyes" in table
    assert "| `A` | still | Looks. | `a` |" in table
    assert "### Arms" in table
    assert "| `B` | fault | Acts. |  |" in table
