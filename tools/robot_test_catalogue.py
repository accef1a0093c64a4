"""Catalogue of the shipped robot tests, grouped by the suites of ``suites/icub``, or of ``suites/any``.

It writes the table of the documentation page on robot tests from the declarations of the tests::

    python tools/robot_test_catalogue.py docs/robot-tests.md
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from rtf.robot_testing.guard.safety import Safety
from rtf.testing.plugin_makers import load_test
from rtf.testing.plugin_source import declared_names
from rtf.testing.plugins import find, shipped_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

BEGIN = "<!-- the tests: written by `python tools/robot_test_catalogue.py`, do not edit -->"
END = "<!-- the tests end -->"
_NOWHERE = "in no suite"


@dataclass(frozen=True, slots=True)
class Entry:
    """A test: its name in suites, its aliases, its safety class, its purpose and the suite it belongs to."""

    name: str
    aliases: tuple[str, ...]
    safety: Safety
    purpose: str
    suite: str


def entries() -> list[Entry]:
    """Return all tests, sorted by the names of their suites and by their places there. Loads every test."""
    folder = shipped_folder("test")
    suites = shipped_folder("suites")
    places = _places(suites / "icub")
    places |= {name: suite for name, suite in _places(suites / "any").items() if name not in places}
    found: dict[str, Entry] = {}
    for path in sorted(folder.glob("*.py")):
        for name, class_name in declared_names(path).items():
            if name == class_name:
                found[name] = _entry(name, folder, places)
    order = list(places)
    return sorted(
        found.values(),
        key=lambda one: (one.suite == _NOWHERE, one.suite, order.index(one.name) if one.name in order else len(order)),
    )


def _entry(name: str, folder: Path, places: dict[str, str]) -> Entry:
    kind = type(load_test(find("test", name, beside=folder)))
    names = dict.fromkeys(word for word in (kind.plugin_name, name, *kind.aliases) if word)
    first = next((word for word in names if word in places), next(iter(names)))
    purpose = " ".join((kind.__doc__ or "").partition("\n\n")[0].split())
    others = tuple(word for word in names if word != first)
    return Entry(first, others, getattr(kind, "safety", Safety.STILL), purpose, places.get(first, _NOWHERE))


def _places(folder: Path) -> dict[str, str]:
    """Return the test names that the suites of a folder use, each with the name of its suite."""
    places: dict[str, str] = {}
    for path in sorted(folder.glob("*.xml")):
        for test in etree.parse(path).iter("test"):
            words = " ".join([test.text or "", *(child.tail or "" for child in test)]).split()
            places.update((word, path.stem) for word in words if word not in places)
    return places


def as_markdown(tests: Iterable[Entry]) -> str:
    """Return one Markdown table for each suite."""
    lines: list[str] = []
    suite = None
    for one in tests:
        if one.suite != suite:
            suite = one.suite
            lines += [*([""] if lines else []), f"### {suite.capitalize()}", ""]
            lines += ["| test | safety | what it does | also called |", "| --- | --- | --- | --- |"]
        aliases = ", ".join(f"`{alias}`" for alias in one.aliases)
        lines.append(f"| `{one.name}` | {one.safety.word} | {one.purpose} | {aliases} |")
    return "\n".join(lines)


def with_table(page: str, table: str) -> str:
    """Return the page with the table between its two markers. Raises ValueError if they are missing."""
    marked, count = re.subn(
        f"({re.escape(BEGIN)}\n).*({re.escape(END)})",
        lambda found: f"{found[1]}\n{table}\n\n{found[2]}",
        page,
        flags=re.DOTALL,
    )
    if count != 1:
        raise ValueError(f"the page must have {BEGIN} and, once, {END}")
    return marked


def main(arguments: Sequence[str]) -> None:
    """Write the table into the page given on the command line."""
    page = Path(arguments[0])
    page.write_text(with_table(page.read_text(encoding="utf-8"), as_markdown(entries())), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
