"""The page on conformance names every test of both suites, and its thresholds are the defaults of the parameters."""

from __future__ import annotations

import re
from pathlib import Path

from robot_test_catalogue import entries

from rtf.testing.plugin_makers import load_test
from rtf.testing.plugin_spec import value_text
from rtf.testing.plugins import find, shipped_folder

PAGE = Path(__file__).parents[2] / "docs" / "conformance.md"
#: Tests of the C++ suite that this project does not have yet, and those of this project that the other does not have.
MISSING: set[str] = set()
OWN = {
    "BatteryTest",
    "CameraMotion",
    "CanBoards",
    "CanBusLoad",
    "CanTimeouts",
    "FtSensorPostures",
    "JointSweep",
    "RgbdTest",
    "SkinTest",
}
ROW = re.compile(r"^\| (?P<name>\w+) \| (?P<value>\S+?)(?: (?P<unit>\S+))? \| (?:C\+\+|chosen)(?![\w+])[^|]* \|$")


def sections() -> dict[str, str]:
    """The text below each heading of the page."""
    parts = re.split(r"^### (.+)\n", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_test_has_a_section():
    """The eleven of the paper first, 31 together with those that are missing."""
    names = [name for heading in sections() for name in heading.split(", ")]
    assert len(names) == len(set(names))
    assert len(set(names) - OWN) == 31
    assert set(names) - MISSING | OWN == {entry.name for entry in entries()}


def test_thresholds_are_defaults_of_parameters():
    """Each with its unit and an origin; a test has at least two."""
    own = {entry.name for entry in entries()}
    for name, text in sections().items():
        rows = [line for line in text.split("## ")[0].splitlines() if line.startswith("| ")][2:]
        if name in own:
            kind = type(load_test(find("test", name, beside=shipped_folder("test"))))
            declared = {parameter.key: parameter for parameter in kind.declarations().values()}
            assert len(rows) >= 2, name
            for row in rows:
                found = ROW.match(row)
                assert found, row
                parameter = declared[found["name"]]
                default = parameter.default[0] if isinstance(parameter.default, list) else parameter.default
                assert value_text(parameter.element(found["value"])) == value_text(default), (name, row)
                assert (found["unit"] or "") == parameter.unit, (name, row)
