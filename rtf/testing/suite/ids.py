"""Ids of tests and suites: what names them in reports, history, links, ``-k`` and pytest's node ids.

An id is made from what a test is, not from where it stands: ``suite/Nod``, ``suite/JointLimits[left_arm]``. It stays
when another test is inserted before it, removed or edited. Only of tests that are the same in everything that the suite
says of them the second ends with ``+2``, the third with ``+3``.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from hashlib import blake2b
from itertools import chain, count
from pathlib import PurePath
from typing import TYPE_CHECKING

from rtf.testing.suite.values import parameter_file_stem, plugin_stem, split_words

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

#: Ids end up in links and file names; most file systems allow 255 bytes for a name.
_MAX_NAME = 100
#: The longest part in brackets that is written out; of a longer one the beginning and a digest are.
_MAX_PIECE = 40
_DIGEST = 6
_UNFIT = re.compile(r"[^A-Za-z0-9._-]+")
_UNFIT_IN_CASE = re.compile(r"[^A-Za-z0-9._\[\]-]+")
_GAPS = re.compile(r"[\s/]+")
#: Stands between the id of a program and its case; no other id has it.
CASE_MARK = "::"
_BRACKETS = re.compile(r"(.*?)\s*\[(.+)\]")
_OPTION = re.compile(r"--?(?=[A-Za-z])")
_LOCAL = re.compile(r"(.*/[^\[+]*)(\[.*\])?(\+[0-9]+)?")
_OLD_NUMBER = re.compile(r"~([0-9]+)$")


class TestIds:
    """Hands out the ids of the tests of one suite."""

    __test__ = False  # keeps pytest from collecting a class by the look of its name

    def __init__(self, suite_id: str) -> None:
        self._suite_id = suite_id
        self._owners: dict[str, str] = {}
        self._names = NameBook("+")

    def unique(self, label: str, *content: object) -> str:
        """Return the id of a test; ``content`` is what makes it another test than those with the same label."""
        made_of = repr(content)
        if self._owners.setdefault(label, made_of) != made_of:
            label = _with_piece(label, digest(made_of))
        return f"{self._suite_id}/{self._names.unique(label)}"


class NameBook:
    """Hands out names that are unique: the second request for ``arm`` gets ``arm~2``, the third ``arm~3``."""

    def __init__(self, mark: str = "~") -> None:
        self._mark = mark
        self._taken: set[str] = set()
        self._counts: Counter[str] = Counter()

    def reserve(self, name: str) -> None:
        """Keep a name from being handed out."""
        self._taken.add(name)

    def unique(self, name: str, *others: str) -> str:
        """Give the first of these names that is free, or ``name`` with the smallest number behind it that is."""
        free = next((candidate for candidate in (name, *others) if candidate not in self._taken), "")
        while not free:
            self._counts[name] += 1
            numbered = f"{name}{self._mark}{self._counts[name] + 1}"
            free = "" if numbered in self._taken else numbered
        self._taken.add(free)
        return free


def suite_id(name: str, file: str, names: NameBook) -> str:
    """Return the id of a suite: its name, and if another suite has that, also the name of its file."""
    plain = slug(name, "suite")
    return names.unique(plain, _with_piece(plain, _fit(PurePath(file).stem, _MAX_PIECE)))


class CaseIds:
    """Hands out the ids of the cases of one program, ``suite/program::case``.

    The id is made from the name of the case alone, unless two names differ in nothing that an id can hold. ``given``
    maps names to ids that they have already.
    """

    def __init__(self, program: str, given: Mapping[str, str] | None = None) -> None:
        self._program = program
        self._ids = dict(given or {})
        self._taken = set(self._ids.values())

    def of(self, name: str) -> str:
        """Return the id of the case with this name; the same one each time."""
        found = self._ids.get(name)
        if found is None:
            plain = f"{self._program}{CASE_MARK}{_label_of_case(name)}"
            with_digest = f"{plain}-{digest(name)}"
            candidates = chain((plain, with_digest), (f"{with_digest}+{number}" for number in count(2)))
            found = self._ids[name] = next(candidate for candidate in candidates if candidate not in self._taken)
            self._taken.add(found)
        return found


def program_of(test: str) -> str:
    """Return the id of the program that a case is of; of a test that is no case, its own id."""
    return test.partition(CASE_MARK)[0]


def _label_of_case(name: str) -> str:
    whole = _GAPS.sub("-", name.strip())
    fit = _fit(whole, _MAX_NAME, _UNFIT_IN_CASE)
    return fit if fit == whole else f"{fit[: _MAX_NAME - _DIGEST - 1]}-{digest(name)}".lstrip("-")


def name_of_plugin(plugin: str, param: str = "", variant: Sequence[str] = ()) -> str:
    """Return the name for people of a test that the suite gives none: plug-in, and values of loops or a file."""
    stem = plugin_stem(plugin)
    piece = " ".join(variant) or parameter_file_stem(param)
    return f"{stem} [{piece}]" if piece else stem


def label_of_plugin(
    plugin: str, param: str = "", parameters: Iterable[tuple[str, str]] = (), variant: Sequence[str] = ()
) -> str:
    """Return the part of an id behind the suite's for a test without a name: plug-in and parameters.

    ``variant`` holds the values of the loops or the matrix that the test is from; they say more than the parameters.
    """
    words = [*variant]
    if not words and parameter_file_stem(param):
        words = [parameter_file_stem(param)]
    if not words:
        words = [*_words(param), *(word for pair in parameters for word in pair)]
    return _with_piece(_fit(plugin_stem(plugin).replace("::", "."), _MAX_NAME) or "test", _piece(words))


def label_of_name(name: str) -> str:
    """Return the part of an id behind the suite's for a test with this name; ``Nod [left]`` becomes ``Nod[left]``."""
    brackets = _BRACKETS.fullmatch(name)
    stem, piece = (brackets[1], brackets[2].split()) if brackets else (name, [])
    return _with_piece(_fit(stem, _MAX_NAME) or "test", _piece(piece))


def varied(test: str, *, class_name: str = "", variant: str = "") -> str:
    """Return the id of a test that is made of the test with this id: of one class of its file, with other values."""
    match = _LOCAL.fullmatch(test)
    stem, piece, number = (match[1], match[2] or "", match[3] or "") if match else (test, "", "")
    stem = f"{stem}.{_fit(class_name, _MAX_NAME)}" if class_name else stem
    return _with_piece(stem + piece, _piece([variant])) + number


def renewed(test: str, suite: str, name: str) -> str:
    """Return the id that a test has now which older versions called ``test``; those made ids of the name alone."""
    local = test.removeprefix(f"{suite}/")
    number = _OLD_NUMBER.search(local)
    label = label_of_name(name)
    if slug(label) != slug(_OLD_NUMBER.sub("", local)):  # the test gave itself another name
        label = _OLD_NUMBER.sub("", local)
    return f"{suite}/{label}" if number is None else f"{suite}/{label}+{number[1]}"


def former(test: str) -> str:
    """Return what older versions called a test with this id, where they can have known it."""
    suite, _, label = test.partition("/")
    label, plus, number = label.partition("+")
    return f"{suite}/{slug(label)}{'~' if plus else ''}{number}"


def digest(text: str, size: int = _DIGEST) -> str:
    """Return a short word that another text will not have."""
    return blake2b(text.encode("utf-8", "backslashreplace"), digest_size=16).hexdigest()[:size]


def slug(text: str, fallback: str = "") -> str:
    """Make a suite's id out of its name: lower case ASCII letters, digits, dots, underscores and dashes."""
    return _fit(text, _MAX_NAME).lower() or fallback


def _words(param: str) -> list[str]:
    try:
        return [_OPTION.sub("", word, count=1) for word in split_words(param, commas=False)]
    except ValueError:  # a quote that is never closed
        return [param]


def _piece(words: Sequence[str]) -> str:
    whole = "-".join(" ".join(words).split())
    fit = _fit(whole, _MAX_PIECE)
    return fit if fit == whole else f"{fit[: _MAX_PIECE - _DIGEST - 1]}-{digest(whole)}".lstrip("-")


def _with_piece(stem: str, piece: str) -> str:
    if not piece:
        return stem
    return f"{stem[:-1]}-{piece}]" if stem.endswith("]") else f"{stem}[{piece}]"


def _fit(text: str, size: int, unfit: re.Pattern[str] = _UNFIT) -> str:
    plain = unicodedata.normalize("NFKD", text[: 4 * _MAX_NAME]).encode("ascii", "ignore").decode("ascii")
    return unfit.sub("-", plain)[:size].strip("-.")
