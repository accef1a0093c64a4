"""The page on events describes the event classes."""

from __future__ import annotations

import re
from pathlib import Path

from rtf.testing.events import KINDS

PAGE = Path(__file__).parents[2] / "docs" / "events.md"


def documented() -> dict[str, set[str]]:
    """The kinds of the page's tables with their members."""
    found = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) > 3 and cells[1].startswith("`"):
            found[cells[1].strip("`")] = set(re.findall(r"`(\w+)`", cells[2]))
    return found


def test_every_kind_is_documented():
    """The kinds of the page are those of the classes."""
    assert set(documented()) == set(KINDS)


def test_every_member_is_documented():
    """The members of each kind are those of its class."""
    for kind, members in documented().items():
        assert set(KINDS[kind].__struct_fields__) - {"seq", "time"} == members, kind
