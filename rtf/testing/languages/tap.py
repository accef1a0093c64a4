"""A reader of the Test Anything Protocol, versions 12 to 14, line by line while the program runs.

The parser turns lines into items. No output of a program can make it raise or grow: what breaks the protocol becomes a
:class:`Fault`, what is not of the protocol is ignored, as the protocol demands. It knows nothing of tests and sessions;
:mod:`rtf.testing.languages.executable` does. The protocol: https://testanything.org.

Subtests are documents indented by four spaces, ended by the test point of their parent, which has the last word: the
failed points of a subtest are held back until that point is read, and are no failures when it is a TODO or skipped. A
stream of version 14 may begin one with any indented line, an older one only after ``# Subtest``. Pragmas are ignored.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, replace

#: More points than this are counted and not reported one by one.
MAX_POINTS = 100_000
#: The greatest depth of subtests.
MAX_DEPTH = 16
#: Characters that are kept of one YAML block, of all blocks together, and of one description; and reported faults.
#: The parser's memory is bounded by these.
MAX_BLOCK = 64 * 1024
MAX_BLOCKS = 16 << 20
MAX_TEXT = 500
MAX_FAULTS = 1000

_VERSIONS = range(12, 15)
_WITH_SUBTESTS = 14
_INDENT = "    "
_BLOCK_INDENT = "  "
_LISTED = 10

_VERSION = re.compile(r"TAP version ([0-9]{1,9})\s*$", re.IGNORECASE)
_PLAN = re.compile(r"1\.\.([0-9]{1,9})\s*(?:#\s*(?:skip\w*[\s:]*)?(.*))?$", re.IGNORECASE)
_POINT = re.compile(r"(not )?ok(?=\s|#|$)(?:\s+([0-9]{1,9})(?=\s|#|$))?(\s+-(?=\s|$))?")
_BAIL_OUT = re.compile(r"Bail out!\s*(.*)$", re.IGNORECASE)
_DIRECTIVE = re.compile(r"(?<!\\)#\s*(?:(skip)\w*|(todo)\b)[\s:]*(.*)$", re.IGNORECASE)
_SUBTEST = re.compile(r"#\s*Subtest(?::\s*(.*))?$", re.IGNORECASE)
_ESCAPED = re.compile(r"\\([\\#])")


@dataclass(frozen=True, slots=True)
class Point:
    """One test point, such as ``ok 3 - description # SKIP reason``.

    ``number`` is None where the line has none, and is then counted. ``path`` names the subtests that it lies in,
    outermost first; ``block`` is the text of its YAML block.
    """

    ok: bool
    number: int | None
    description: str = ""
    directive: str = ""  # "skip", "todo" or none
    reason: str = ""
    path: tuple[str, ...] = ()
    block: str = ""

    @property
    def failed(self) -> bool:
        """Whether the point counts against the test: neither TODO points nor skipped ones do."""
        return not self.ok and not self.directive


@dataclass(frozen=True, slots=True)
class Comment:
    """A diagnostic line, without its ``#``."""

    text: str
    path: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fault:
    """The stream contradicts itself, so the test fails: a plan that is not kept, a number that comes twice."""

    text: str
    path: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SkippedAll:
    """The plan is ``1..0``: there is nothing to test here."""

    reason: str


@dataclass(frozen=True, slots=True)
class BailOut:
    """The program gives up; nothing after this counts."""

    reason: str


Item = Point | Comment | Fault | SkippedAll | BailOut


def _read_point(text: str) -> Point | None:
    match = _POINT.match(text)
    if match is None:
        return None
    rest = text[match.end() :]
    directive, reason = "", ""
    if found := _DIRECTIVE.search(rest):
        directive, reason = (found[1] or found[2]).lower(), found[3]
        rest = rest[: found.start()]
    description, reason = (_ESCAPED.sub(r"\1", part.strip())[:MAX_TEXT] for part in (rest, reason))
    return Point(not match[1], int(match[2]) if match[2] else None, description, directive, reason)


def looks_like_tap(text: str) -> bool:
    """Return whether a program with this first line that is not empty speaks the protocol.

    A version, a plan, or a test point that has more to it than the bare word ``ok``, which any program may print.
    """
    text = text.rstrip()
    point = _POINT.match(text)
    if point is None:
        return bool(_VERSION.match(text) or _PLAN.match(text))
    return bool(point[2] or point[3]) or text[point.end() :].lstrip().startswith("#")


class TapParser:
    """Reads a stream, or one subtest of it. ``feed`` takes a line, ``finish`` says that there are no more.

    Both return the items that are known now. A point is returned when the line after it is read, because its YAML block
    may follow it.
    """

    def __init__(self, path: tuple[str, ...] = (), version: int = 12, spent: Counter[str] | None = None) -> None:
        self._path = path
        self._version = version
        self._spent: Counter[str] = Counter() if spent is None else spent  # of the limits, by the whole stream
        self._found: list[Item] = []  # since the last time
        self._over = False  # the program has bailed out
        self._begun = False
        self._point: Point | None = None  # waits for its YAML block
        self._block: list[str] | None = None
        self._block_room = 0
        self._subtest: TapParser | None = None
        self._announced: str | None = None  # name of the subtest that a comment said would follow
        self._held: list[Point | Fault] = []  # failures of the subtest
        self._plan: int | None = None
        self._plan_within: int | None = None  # points that came before the plan, until one comes after it
        self._points = 0
        self._last = 0
        self._numbers: set[int] = set()

    def feed(self, text: str) -> list[Item]:
        """Take one line, with or without its line end."""
        text = text.rstrip()
        if not self._over and not self._in_block(text):
            self._release()
            body = text.lstrip(" ")
            indent = len(text) - len(body)
            if self._subtest is None and self._begins_subtest(body, indent):
                name = self._announced or f"subtest {self._last + 1}"
                self._subtest = TapParser((*self._path, name[:MAX_TEXT]), self._version, self._spent)
                self._announced = None
            if self._subtest is not None and (not text or text.startswith(_INDENT)):
                self._relay(self._subtest.feed(text.removeprefix(_INDENT)))
            else:
                self._take(body, indented=indent > 0)
        return self._give()

    def finish(self, *, cut_off: bool = False) -> list[Item]:
        """Return what is missing. When the program was ``cut_off``, an incomplete plan is a mere consequence."""
        self._release()
        if not self._over:
            self._end_subtest(cut_off=cut_off)
            if not cut_off:
                self._check_plan()
            if self._spent["failures"] and not self._path:
                self._found.append(Fault(f"{self._spent['failures']} more test points failed"))
        return self._give()

    def _give(self) -> list[Item]:
        found, self._found = self._found, []
        return found

    # YAML blocks -----------------------------------------------------------------------------------------------------

    def _in_block(self, text: str) -> bool:
        """Whether a line belongs to the YAML block of the point that waits; such a block begins right behind it."""
        if self._point is None:
            return False
        if self._block is None:
            if text != f"{_BLOCK_INDENT}---":
                return False
            self._block, self._block_room = [], min(MAX_BLOCK, MAX_BLOCKS - self._spent["blocks"])
        elif text and not text.startswith(_BLOCK_INDENT):
            return False  # the block was never ended
        elif text == f"{_BLOCK_INDENT}...":
            self._release()
        elif self._block_room > 0:
            self._block.append(text.removeprefix(_BLOCK_INDENT)[: self._block_room])
            size = len(self._block[-1]) + 1
            self._block_room -= size
            self._spent["blocks"] += size
        return True

    def _release(self) -> None:
        """Add the waiting point, with its block, to the items."""
        if self._point is not None:
            self._found.append(replace(self._point, block="\n".join(self._block or ())))
            self._point = self._block = None

    # Subtests --------------------------------------------------------------------------------------------------------

    def _begins_subtest(self, body: str, indent: int) -> bool:
        if indent == 0 or indent % len(_INDENT) or len(self._path) == MAX_DEPTH:
            return False
        if self._version < _WITH_SUBTESTS and (self._announced is None or indent > len(_INDENT)):
            return False
        return any(line.match(body) for line in (_POINT, _PLAN, _VERSION))

    def _relay(self, items: list[Item]) -> None:
        """Pass on the items of a subtest; its failures when it has ended."""
        for item in items:
            if isinstance(item, BailOut):
                self._over = True
                self._found += self._held
            if isinstance(item, Fault) or (isinstance(item, Point) and item.failed):
                self._held.append(item)
            else:
                self._found.append(item)

    def _end_subtest(self, directive: str = "", *, cut_off: bool = False) -> None:
        """End the subtest. Its failures count unless the point that ends it has a directive."""
        if self._subtest is not None:
            self._relay(self._subtest.finish(cut_off=cut_off))
            self._found += [_excused(item, directive) for item in self._held] if directive else self._held
            self._subtest, self._held = None, []

    # Lines -----------------------------------------------------------------------------------------------------------

    def _take(self, body: str, *, indented: bool) -> None:
        if match := _BAIL_OUT.match(body):
            self._end_subtest(cut_off=True)
            self._over = True
            self._found.append(BailOut(match[1].strip()))
        elif match := _SUBTEST.match(body):
            if not indented:  # older producers indent the comment, too
                self._end_subtest()
            self._announced = (match[1] or "").strip()
        elif body.startswith("#"):
            self._found.append(Comment(body[1:].strip(), self._path))
        elif indented:
            return
        elif match := _PLAN.match(body):
            self._end_subtest()
            self._take_plan(int(match[1]), (match[2] or "").strip())
        elif match := _VERSION.match(body):
            self._take_version(int(match[1]))
        elif point := _read_point(body):
            self._end_subtest(point.directive)
            self._take_point(point)
        else:
            return
        self._begun = True

    def _take_version(self, version: int) -> None:
        if self._path:
            return
        if self._begun:
            self._fault(f"TAP version {version} stands in the middle of the stream")
        elif version not in _VERSIONS:
            self._fault(f"TAP version {version} is not known; known are 12, 13 and 14")
        else:
            self._version = version

    def _take_plan(self, count: int, reason: str) -> None:
        if self._plan is not None:
            self._fault(f"a second plan 1..{count} after 1..{self._plan}")
            return
        self._plan = count
        self._plan_within = self._points
        if count == 0 and not self._path:
            self._found.append(SkippedAll(reason))

    def _take_point(self, point: Point) -> None:
        number = self._last + 1 if point.number is None else point.number
        self._announced = None
        self._last = number
        self._points += 1
        self._spent["points"] += 1
        if self._spent["points"] > MAX_POINTS:
            if self._spent["points"] == MAX_POINTS + 1:
                text = f"more than {MAX_POINTS} test points; of the rest only failures are counted"
                self._found.append(Comment(text))
            self._spent["failures"] += point.failed
            return
        if self._plan_within:
            self._plan_within = None
            self._fault("the plan stands neither before nor after all test points")
        if number in self._numbers:
            self._fault(f"test point {number} comes twice")
        elif number == 0 or (self._plan is not None and number > self._plan):
            plan = "" if self._plan is None else f" 1..{self._plan}"
            self._fault(f"test point {number} is outside the plan{plan}")
        self._numbers.add(number)
        self._point = replace(point, number=number, path=self._path)

    def _fault(self, text: str) -> None:
        self._spent["faults"] += 1
        if self._spent["faults"] <= MAX_FAULTS:
            self._found.append(Fault(text, self._path))

    def _check_plan(self) -> None:
        if self._plan is None:
            text = "there is no plan (1..N), so nobody knows whether all test points came"
            self._found.append(Fault(text, self._path))
        elif self._points != self._plan:
            text = f"{self._plan} test points planned, {self._points} came"
            missing = [n for n in range(1, min(self._plan, MAX_POINTS) + 1) if n not in self._numbers][: _LISTED + 1]
            if missing and self._spent["points"] <= MAX_POINTS:
                more = " …" if len(missing) > _LISTED else ""
                text += f"; missing: {', '.join(map(str, missing[:_LISTED]))}{more}"
            self._found.append(Fault(text, self._path))


def _excused(item: Point | Fault, directive: str) -> Item:
    """Return what to report of a failure in a subtest that is a TODO or skipped itself."""
    return replace(item, directive=directive) if isinstance(item, Point) else Comment(item.text, item.path)
