"""The glossary lists terms that are in use, each once."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "glossary.md"
#: The code, and the pages and the texts of the web page.
_USES = ("rtf/**/*.py", "reports/**/*.py", "reports/page/*.js", "fixtures/*.py", "icub_tests/*.py", "docs/*.md")


def _words(text: str) -> str:
    """Return the words of a text in lower case, separated by single blanks; `PluginSpec` is two of them."""
    return " ".join(re.findall(r"[a-z0-9]+", re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", text).lower()))


def terms() -> list[str]:
    """Return the terms in the first column of the tables, without explanations in parentheses."""
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    named = [re.sub(r" *\([^)]*\)", "", row) for row in rows if row not in ("term", "---")]
    return [term for row in named for term in row.split(", ")]


@pytest.fixture(scope="module")
def words() -> str:
    """The words of the code and of the pages, those of identifiers included."""
    files = [path for pattern in _USES for path in sorted(ROOT.glob(pattern)) if path != PAGE]
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    return _words(text)


def test_the_terms_are_found():
    """The tables have rows, and no term twice in one of them."""
    assert len(terms()) > 50
    for table in PAGE.read_text(encoding="utf-8").split("## ")[1:]:
        rows = re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE)
        assert len(rows) == len(set(rows))


@pytest.mark.parametrize("term", terms())
def test_a_term_is_in_use(term: str, words: str):
    """Each term occurs in the code or on another page; its plural counts."""
    assert re.search(rf"\b{_words(term)}(s|es)?\b", words), f"{term!r} is in the glossary only: remove it"
