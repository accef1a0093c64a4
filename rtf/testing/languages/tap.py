"""What a program says in the Test Anything Protocol, versions 12 to 14, line by line while it runs.

The parser turns lines into items. Nothing a program can write makes it raise or grow: what breaks the protocol becomes
a :class:`Fault`, what is not of the protocol is passed over, as the protocol demands. It knows nothing of tests and
sessions; :mod:`rtf.testing.languages.executable` does. The protocol: https://testanything.org.

Subtests are documents indented by four spaces, ended by the test point of their parent, which has the last word: the
failed points of a subtest are held back until that point is read, and are no failures when it is a TODO or skipped. A
stream of version 14 may begin one with any indented line, an older one only after ``# Subtest``. Pragmas are ignored.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

#: More points than this are counted and not told one by one.
MAX_POINTS = 100_000
#: Levels of subtests that are told apart.
MAX_DEPTH = 16
#: Characters that are kept of one YAML block, of all that wait at a time, and of one description; and faults that are
#: told. The parser's memory is bounded by these.
MAX_BLOCK = 64 * 1024
MAX_BLOCKS = 16 << 20
MAX_TEXT = 500
MAX_FAULTS = 1000

_VERSIONS = range(12, 15)
_WITH_SUBTESTS = 14
_INDENT = 4
_BLOCK_INDENT = 2
_LISTED = 10

_VERSION = re.compile(r"TAP version ([0-9]{1,9})\s*$", re.IGNORECASE)
_PLAN = re.compile(r"1\.\.([0-9]{1,9})\s*(?:#\s*(.*))?$")
_POINT = re.compile(r"(not )?ok(?=\s|#|$)(?:\s+([0-9]{1,9})(?=\s|#|$))?")
_BAIL_OUT = re.compile(r"Bail out!\s*(.*)$", re.IGNORECASE)
_DIRECTIVE = re.compile(r"(?<!\\)#\s*(skip|todo)(\w*)[\s:]*", re.IGNORECASE)
_SKIP_WORD = re.compile(r"skip\w*[\s:]*", re.IGNORECASE)
_SUBTEST = re.compile(r"#\s*Subtest(?::\s*(.*))?$", re.IGNORECASE)
_ESCAPED = re.compile(r"\\([\\#])")


# What is found in a stream -------------------------------------------------------------------------------------------


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
        """Whether it counts against the test: neither TODO points nor skipped ones do."""
        return not self.ok and not self.directive


@dataclass(frozen=True, slots=True)
class Comment:
    """A diagnostic line, without its ``#``."""

    text: str
    path: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fault:
    """The stream contradicts itself: a plan that is not kept, a number that comes twice."""

    text: str
    path: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Always: a broken stream cannot be a passed test."""
        return True


@dataclass(frozen=True, slots=True)
class SkippedAll:
    """The plan is ``1..0``: there is nothing to test here."""

    reason: str


@dataclass(frozen=True, slots=True)
class BailOut:
    """The program gives up; nothing after this counts."""

    reason: str


Item = Point | Comment | Fault | SkippedAll | BailOut


# Lines that are no items: the parser keeps what they say.


@dataclass(frozen=True, slots=True)
class _Version:
    number: int


@dataclass(frozen=True, slots=True)
class _Plan:
    count: int
    reason: str


@dataclass(frozen=True, slots=True)
class _Subtest:
    name: str


_Line = Point | Comment | BailOut | _Version | _Plan | _Subtest


def _read_line(text: str) -> _Line | None:
    """Read one line without its indentation and line end; None for a line that is not of the protocol."""
    first = text[:1]
    if first == "#":
        match = _SUBTEST.match(text)
        return _Subtest((match[1] or "").strip()) if match else Comment(text[1:].strip())
    if first in "on":
        return _read_point(text)
    if first == "1":
        match = _PLAN.match(text)
        return _Plan(int(match[1]), _SKIP_WORD.sub("", match[2] or "", count=1).strip()) if match else None
    if first in "Tt":
        match = _VERSION.match(text)
        return _Version(int(match[1])) if match else None
    match = _BAIL_OUT.match(text)
    return BailOut(match[1].strip()) if match else None


def _read_point(text: str) -> Point | None:
    match = _POINT.match(text)
    if match is None:
        return None
    rest = text[match.end() :]
    directive, reason = "", ""
    found = next((d for d in _DIRECTIVE.finditer(rest) if d[1].lower() == "skip" or not d[2]), None)
    if found is not None:
        directive, reason = found[1].lower(), rest[found.end() :].strip()
        rest = rest[: found.start()]
    description = _ESCAPED.sub(r"\1", rest.strip().removeprefix("- ").strip())
    if description == "-":
        description = ""
    reason = _ESCAPED.sub(r"\1", reason)
    number = int(match[2]) if match[2] else None
    return Point(not match[1], number, description[:MAX_TEXT], directive, reason[:MAX_TEXT])


def looks_like_tap(text: str) -> bool:
    """Whether a program whose first line that is not empty is ``text`` speaks the protocol.

    A version, a plan, or a test point that has more to it than the bare word ``ok``, which any program may print.
    """
    line = _read_line(text.rstrip())
    if isinstance(line, Point):
        return line.number is not None or text.split("ok", 1)[1].lstrip().startswith(("- ", "#"))
    return isinstance(line, _Version | _Plan)


# What lines mean together --------------------------------------------------------------------------------------------


@dataclass(slots=True)
class _Level:
    """One document: the stream itself, or a subtest."""

    path: tuple[str, ...] = ()
    announced: str | None = None  # name of the subtest that a comment said would follow
    plan: int | None = None
    plan_after: int = 0  # points that came before the plan
    points: int = 0
    last: int = 0
    seen: set[int] = field(default_factory=set)
    misplaced: bool = False
    held: list[Point | Fault] = field(default_factory=list)


class TapParser:
    """Reads one stream. ``feed`` takes a line, ``finish`` says that there are no more; both give what is known now.

    A point is given when the line after it is read, because its YAML block may follow it.
    """

    def __init__(self) -> None:
        self.version = 12
        self.bailed_out = False
        self._found: list[Item] = []  # since the last time
        self._levels = [_Level()]
        self._point: Point | None = None  # waits for its YAML block
        self._block: list[str] | None = None
        self._block_indent = ""
        self._block_size = 0
        self._all_blocks = 0
        self._faults = 0
        self._told = 0
        self._untold_failures = 0
        self._begun = False

    def feed(self, text: str) -> list[Item]:
        """Take one line, with or without its line end."""
        text = text.rstrip()
        if not self.bailed_out and not self._in_block(text):
            self._release()
            body = text.lstrip(" ")
            line = _read_line(body)
            if line is not None:
                self._take(line, len(text) - len(body))
        return self._give()

    def finish(self, *, cut_off: bool = False) -> list[Item]:
        """Say what is missing. When the program was ``cut_off``, a plan that is not kept is a mere consequence."""
        self._release()
        if self.bailed_out:
            return self._give()
        if cut_off:
            self._give_held()
        else:
            self._close_to(0)
            self._found += self._missing(self._levels[0])
        if self._untold_failures:
            self._found.append(Fault(f"{self._untold_failures} more test points failed"))
        return self._give()

    def _give(self) -> list[Item]:
        found, self._found = self._found, []
        return found

    def _give_held(self) -> None:
        for level in self._levels:
            self._found += level.held

    # YAML blocks ---------------------------------------------------------------------------------------------------

    def _in_block(self, text: str) -> bool:
        """Whether a line belongs to the YAML block of the point that waits; such a block begins right behind it."""
        if self._point is None:
            return False
        indent = self._block_indent
        if self._block is None:
            if text != f"{indent}---":
                return False
            self._block = []
            self._block_size = 0
        elif text and not text.startswith(indent):
            return False  # the block was never ended
        elif text == f"{indent}...":
            self._release()
        elif self._block_size < MAX_BLOCK and self._all_blocks < MAX_BLOCKS:
            self._block.append(text[len(indent) :][: MAX_BLOCK - self._block_size])
            self._block_size += len(self._block[-1]) + 1
        return True

    def _release(self) -> None:
        """Give the waiting point with its block, or hold it back when it failed inside a subtest."""
        point, block = self._point, self._block
        self._point = self._block = None
        if point is None:
            return
        if block is not None:
            point = replace(point, block="\n".join(block))
            self._all_blocks += self._block_size
        if point.failed and point.path:
            self._levels[-1].held.append(point)
        else:
            self._found.append(point)

    # Lines -----------------------------------------------------------------------------------------------------------

    def _take(self, line: _Line, indent: int) -> None:
        if isinstance(line, BailOut):
            self.bailed_out = True
            self._give_held()
            self._found.append(line)
            return
        depth, rest = divmod(indent, _INDENT)
        if rest or not self._reach(depth, line):
            if isinstance(line, Comment):
                self._found.append(replace(line, path=self._levels[-1].path))
            return
        level = self._levels[depth]
        match line:
            case Point():
                self._take_point(line, level)
                self._block_indent = " " * (indent + _BLOCK_INDENT)
            case _Plan():
                self._take_plan(line, level)
            case _Subtest():
                level.announced = line.name
            case Comment():
                self._found.append(replace(line, path=level.path))
            case _Version():
                self._take_version(line, level)
        self._begun = True

    def _reach(self, depth: int, line: _Line) -> bool:
        """Open or close subtests until the line's level is the current one. False when there is no such level."""
        current = len(self._levels) - 1
        if depth > current:
            if isinstance(line, Comment) or depth > MAX_DEPTH:
                return False
            if isinstance(line, _Subtest):  # older producers indent the comment too
                self._levels[-1].announced = line.name
                return False
            if self.version < _WITH_SUBTESTS and (self._levels[-1].announced is None or depth > current + 1):
                return False
            while len(self._levels) <= depth:
                self._open()
        elif depth < current and isinstance(line, Point):
            self._close_to(depth, line.directive)
        elif depth < current and isinstance(line, _Plan | _Subtest):
            self._close_to(depth)
        return True

    def _open(self) -> None:
        parent = self._levels[-1]
        name = (parent.announced or f"subtest {parent.last + 1}")[:MAX_TEXT]
        parent.announced = None
        self._levels.append(_Level((*parent.path, name)))

    def _close_to(self, depth: int, directive: str = "") -> None:
        """End the subtests below ``depth``; their failures count unless the parent's point has a directive."""
        while len(self._levels) - 1 > depth:
            level = self._levels.pop()
            held = [*level.held, *self._missing(level)]
            parent = self._levels[-1]
            if directive and len(self._levels) - 1 == depth:
                self._found += [_excuse(item, directive) for item in held]
            elif parent.path:
                parent.held += held
            else:
                self._found += held

    def _take_version(self, line: _Version, level: _Level) -> None:
        if level.path:
            return
        if self._begun:
            self._fault(f"TAP version {line.number} stands in the middle of the stream", level)
        elif line.number not in _VERSIONS:
            self._fault(f"TAP version {line.number} is not known; known are 12, 13 and 14", level)
        else:
            self.version = line.number

    def _take_plan(self, line: _Plan, level: _Level) -> None:
        if level.plan is not None:
            self._fault(f"a second plan 1..{line.count} after 1..{level.plan}", level)
            return
        level.plan = line.count
        level.plan_after = level.points
        if line.count == 0 and not level.path:
            self._found.append(SkippedAll(line.reason))

    def _take_point(self, line: Point, level: _Level) -> None:
        number = level.last + 1 if line.number is None else line.number
        level.announced = None
        level.last = number
        level.points += 1
        self._told += 1
        if self._told > MAX_POINTS:
            if self._told == MAX_POINTS + 1:
                self._found.append(
                    Comment(f"more than {MAX_POINTS} test points; of the rest only failures are counted")
                )
            self._untold_failures += line.failed
            return
        if level.plan is not None and level.plan_after and not level.misplaced:
            level.misplaced = True
            self._fault("the plan stands neither before nor after all test points", level)
        if number in level.seen:
            self._fault(f"test point {number} comes twice", level)
        elif number == 0 or (level.plan is not None and number > level.plan):
            plan = "" if level.plan is None else f" 1..{level.plan}"
            self._fault(f"test point {number} is outside the plan{plan}", level)
        level.seen.add(number)
        self._point = replace(line, number=number, path=level.path)

    def _fault(self, text: str, level: _Level) -> None:
        self._faults += 1
        if self._faults <= MAX_FAULTS:
            (level.held if level.path else self._found).append(Fault(text, level.path))

    def _missing(self, level: _Level) -> list[Fault]:
        if level.plan is None:
            return [Fault("there is no plan (1..N), so nobody knows whether all test points came", level.path)]
        if level.points == level.plan:
            return []
        text = f"{level.plan} test points planned, {level.points} came"
        absent = [n for n in range(1, min(level.plan, MAX_POINTS) + 1) if n not in level.seen][: _LISTED + 1]
        if absent and self._told <= MAX_POINTS:
            more = " …" if len(absent) > _LISTED else ""
            text += f"; missing: {', '.join(map(str, absent[:_LISTED]))}{more}"
        return [Fault(text, level.path)]


def _excuse(item: Point | Fault, directive: str) -> Item:
    if isinstance(item, Point):
        return replace(item, directive=directive)
    return Comment(item.text, item.path)
