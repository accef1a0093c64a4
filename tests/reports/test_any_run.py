"""Properties of any run: its reports are well formed, complete, and the same when they are made again."""

from __future__ import annotations

import contextlib
import io
import json
import re
import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import jsonschema
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from junitparser import xunit2
from lxml import etree
from msgspec.structs import replace

from rtf.testing import events as e
from rtf.testing import journal, plugins
from rtf.testing.broadcast import Broadcast
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.reporting import ReportOptions, load_reporter
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rtf.testing.results import RunResult

SCHEMA = etree.XMLSchema(etree.parse(Path(__file__).parents[1] / "data" / "junit" / "junit-10.xsd"))
RESULT_SCHEMA = json.loads((plugins.shipped_folder("report") / "result.schema.json").read_bytes())
VALIDATOR = jsonschema.Draft202012Validator(RESULT_SCHEMA)
FILES = ("junit", "json", "ctrf", "text")
CONSOLES = ("console", "classic")

NASTY = st.sampled_from(
    [
        "",
        " ",
        "]]>",
        "\x1b[31m",
        "a\x00b",
        "\ud800",
        "\udc80\ud83d",
        "\ud83d\udc80",
        "<b>&amp;",
        "\r\n",
        "\ufffe\uffff",
        "é…😀",
    ],
)
TEXT = NASTY | st.text(st.characters(), max_size=8) | st.text(st.characters(categories=["Cc", "Cs", "Cf"]), max_size=4)
NUMBER = st.floats(width=32) | st.sampled_from([0.0, 1e-9, -1.0, 1e300])
LENGTH = st.floats(0, 1e6, allow_nan=False)
SUITES = ("s1", "s2", "s3")


@st.composite
def said_of_a_test(draw: st.DrawFn, test: str):  # noqa: PLR0911 - one for each kind
    """Draw an event that a test sends."""
    text = draw(TEXT)
    kind = draw(st.integers(0, 8))
    if kind == 0:
        severity = draw(st.sampled_from(Severity))
        value = draw(NUMBER | TEXT | st.none())
        return e.Message(
            severity=severity, title=text, detail=draw(TEXT), test=test, subject=text, file=text, line=3, value=value
        )
    if kind == 1:
        low = draw(NUMBER | st.none())
        return e.Measured(
            test=test,
            name=text,
            value=draw(NUMBER),
            unit=text,
            low=low,
            verdict=draw(st.sampled_from(MeasurementVerdict)),
        )
    if kind == 2:
        return e.OutputCaptured(
            stream=draw(st.sampled_from(["stdout", "stderr"]) | TEXT), text=text, test=test, omitted=1
        )
    if kind == 3:
        return e.SubResultEnded(test=test, subject=text, verdict=draw(st.sampled_from(Verdict)), reason=text)
    if kind == 4:
        return e.Attached(test=test, name=text, path=text, media_type=text)
    if kind == 5:
        return e.StackDumped(text=text, cause=text, test=test)
    if kind == 6:
        return e.ParametersResolved(
            test=test, parameters=({"name": text, "value": text, "unit": text, "source": text},)
        )
    if kind == 7:
        return e.SeriesRecorded(test=test, name=text, path=text, columns=({"name": text, "unit": text},), rows=2)
    return e.TestRenamed(test=test, name=text, description=text)


@st.composite
def of_a_fixture(draw: st.DrawFn, suite: str):
    """Draw an event of a fixture or a suite."""
    text, name = draw(TEXT), draw(st.sampled_from(["sim", "\x1b<&"]))
    kind = draw(st.integers(0, 3))
    if kind == 0:
        phase, test = draw(st.sampled_from(Phase)), draw(TEXT)
        return e.FixtureIncident(
            fixture=name, suite=suite, generation=1, phase=phase, cause=text, output=text, test=test, exit_status=1
        )
    if kind == 1:
        state = draw(st.sampled_from(FixtureState))
        return e.FixtureChanged(fixture=name, suite=suite, generation=draw(st.integers(1, 3)), state=state, detail=text)
    if kind == 2:
        severity = draw(st.sampled_from(Severity))
        return e.Message(
            severity=severity, title=text, detail=text, suite=suite, fixture=draw(st.sampled_from(["", name]))
        )
    return e.OutputCaptured(stream="stdout", text=text, suite=suite, fixture=name)


@st.composite
def runs(draw: st.DrawFn):
    """Draw the events of a run, perhaps one that was cut off."""
    events = [e.RunStarted(run=draw(TEXT), version="1", robot=draw(TEXT), environment={draw(TEXT): draw(TEXT)})]
    plan = {suite: draw(st.integers(0, 3)) for suite in SUITES[: draw(st.integers(1, 3))]}
    for suite, count in plan.items():
        events.append(e.SuitePlanned(suite=suite, name=draw(TEXT), file=draw(TEXT), description=draw(TEXT)))
        events += [
            e.TestPlanned(
                test=f"{suite}/{n}", suite=suite, name=draw(TEXT), file=draw(TEXT), line=n, tags=(draw(TEXT),)
            )
            for n in range(count)
        ]
    for suite, count in plan.items():
        events.append(e.SuiteStarted(suite=suite))
        for number in range(count):
            test = f"{suite}/{number}"
            events += draw(st.lists(of_a_fixture(suite), max_size=2))
            attempts = draw(st.sampled_from([1, 2, 0]))
            for attempt in range(1, attempts + 1):
                events.append(e.TestStarted(test=test, attempt=attempt))
                events += draw(st.lists(said_of_a_test(test), max_size=4))
                verdict, final = draw(st.sampled_from(Verdict)), attempt == attempts
                events.append(
                    e.TestEnded(
                        test=test,
                        verdict=verdict,
                        outcome=verdict,
                        attempt=attempt,
                        final=final,
                        reason=draw(TEXT),
                        detail=draw(TEXT),
                        duration=draw(LENGTH),
                    ),
                )
        events.append(e.SuiteEnded(suite=suite, verdict=draw(st.sampled_from(Verdict)), duration=draw(LENGTH)))
    text = draw(TEXT)
    events += draw(
        st.lists(
            st.sampled_from(
                [
                    e.Diagnosed(severity=Severity.ERROR, text=text, file=text, line=1, hint=text, suite=text),
                    e.InternalError(text=text, traceback=text),
                    e.Interrupted(source=text, stage=1),
                    e.StackDumped(text=text, cause=text, fixture="sim"),
                ],
            ),
            max_size=2,
        ),
    )
    steps = draw(st.lists(st.floats(0, 20), min_size=len(events), max_size=len(events)))
    now = 1.75e9
    timed = []
    for event, step in zip(events, steps, strict=True):
        now += step
        timed.append(replace(event, time=now))
    return timed[: draw(st.none() | st.integers(1, len(timed)))], draw(st.booleans())


loaded = cache(load_reporter)


def make(
    folder: Path,
    names: Iterable[str],
    events: list[e.Event],
    *,
    ended: bool,
    verbosity: int = 0,
    extra: dict[str, str] | None = None,
    journal_path: Path | None = None,
):
    """Give the events to reporters, live; with ``ended`` the run ends with the exit code of its results."""
    reporters = []
    for name in names:
        cls = loaded(name)
        target = folder / cls.default_file if cls.default_file else None
        reporters.append(cls(ReportOptions(target, Path("run"), verbosity=verbosity, extra=extra or {})))
        reporters[-1].open()
    broadcast = Broadcast(journal.Journal(journal_path) if journal_path else None, [*reporters])
    results = broadcast.results
    for event in events:
        broadcast.emit(event)
    if ended:
        code = int(results.exit_code())
        broadcast.emit(
            e.RunEnded(time=events[-1].time, verdict=results.verdict(), exit_code=code, duration=1.0),
        )
    broadcast.close()
    assert not [error for error in results.internal_errors if "left out" in error.text]
    return results


def written(folder: Path):
    """Return the bytes of the files of a folder, by name."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".jsonl"}


def check_junit(data: bytes, results: RunResult, *, strict: bool):
    """Check that a JUnit file is valid, complete and unambiguous, and red exactly when the exit code is not 0."""
    root = etree.fromstring(data)
    if strict:
        SCHEMA.assertValid(root)
    cases = [*root.iter("testcase")]
    identities = [(case.get("classname"), case.get("name")) for case in cases]
    assert len(set(identities)) == len(identities)
    assert len(cases) >= len(results.tests)
    errors, failures = len(root.findall(".//error")), len(root.findall(".//failure"))
    assert (str(len(cases)), str(failures), str(errors)) == tuple(root.get(n) for n in ("tests", "failures", "errors"))
    code = results.ended.exit_code if results.ended else int(results.exit_code())
    killed = results.ended is None
    assert bool(errors + failures) == (bool(code) or killed)
    assert all(
        element.get("message").strip() and element.text.strip() for element in root.iter("failure", "error", "skipped")
    )
    read_back = xunit2.JUnitXml.fromstring(data)
    assert len(cases) == sum(1 for suite in read_back for _ in suite)


def refuse(word: str):
    """Fail for the numbers that JSON lacks."""
    raise AssertionError(word)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(runs(), st.sampled_from(["strict", "rich"]))
def test_every_report_of_any_run_is_well_formed_and_can_be_made_again(run: tuple[list[e.Event], bool], family: str):
    """A report made from the journal has the same bytes as the live one, is well formed, and has every planned test."""
    events, ended = run
    with tempfile.TemporaryDirectory() as name:
        live, again = Path(name) / "live", Path(name) / "again"
        live.mkdir()
        again.mkdir()
        extra = {"junit-family": family}
        results = make(live, FILES, events, ended=ended, extra=extra, journal_path=live / journal.FILE_NAME)
        make(again, FILES, [*journal.read(live)], ended=False, extra=extra)
        files = written(live)
        assert files == written(again)
    check_junit(files["junit.xml"], results, strict=family == "strict")
    document = json.loads(files["result.json"], parse_constant=refuse)
    VALIDATOR.validate(document)
    assert [*results.tests] == [test["id"] for suite in document["suites"] for test in suite["tests"]]
    ctrf = json.loads(files["ctrf.json"], parse_constant=refuse)["results"]
    code = results.ended.exit_code if results.ended else int(results.exit_code())
    assert bool(ctrf["summary"]["failed"]) == (bool(code) or results.ended is None)
    assert len(ctrf["tests"]) == ctrf["summary"]["tests"] >= len(results.tests)
    assert not re.search(rb"[\x00-\x08\x0b-\x1f\x7f]", files["result.txt"])


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(runs(), st.integers(-1, 2))
def test_consoles_show_any_run_and_keep_the_terminal_whole(run: tuple[list[e.Event], bool], verbosity: int):
    """No control character reaches the terminal, and the verdict is the last line."""
    events, ended = run
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        make(Path(), CONSOLES, events, ended=ended, verbosity=verbosity)
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\ud800-\udfff]", out.getvalue() + err.getvalue())


LONG = "x]]>\x1b" + "y" * 1_000_000


@pytest.mark.parametrize("family", ["strict", "rich"])
def test_a_megabyte_in_every_text_is_survived(tmp_path: Path, family: str):
    """With a line of a megabyte in every field, all files are valid, and the JUnit file stays readable."""
    test = "s1/" + LONG
    said = [
        e.Message(
            severity=Severity.FAILURE, title=LONG, detail=LONG, test=test, subject=LONG, file=LONG, traceback=LONG
        ),
        e.Measured(test=test, name=LONG, value=1.0, unit=LONG, low=0.0, subject=LONG),
        e.OutputCaptured(stream="stdout", text=LONG, test=test),
        e.OutputCaptured(stream="stderr", text=LONG, test=test),
        e.SubResultEnded(test=test, subject=LONG, verdict=Verdict.FAILED, reason=LONG),
        e.Attached(test=test, name=LONG, path=LONG),
        e.StackDumped(text=LONG, cause=LONG, test=test),
    ]
    ended = e.TestEnded(test=test, verdict=Verdict.FAILED, outcome=Verdict.FAILED, reason=LONG, detail=LONG)
    again = [
        e.TestStarted(test=test),
        *said,
        replace(ended, final=False),
        e.TestStarted(test=test, attempt=2),
        *said,
        ended,
    ]
    events = [
        e.RunStarted(run=LONG, version=LONG, robot=LONG),
        e.SuitePlanned(suite="s1", name=LONG, file=LONG, description=LONG),
        e.TestPlanned(test=test, suite="s1", name=LONG, plugin=LONG, param=LONG, file=LONG),
        e.SuiteStarted(suite="s1"),
        e.FixtureIncident(
            fixture=LONG, suite="s1", generation=1, phase=Phase.CHECK, cause=LONG, output=LONG, traceback=LONG
        ),
        *again,
        e.SuiteEnded(suite="s1", verdict=Verdict.FAILED, duration=1.0),
    ]
    strict = family == "strict"  # the other files are the same in both
    results = make(tmp_path, FILES if strict else ("junit",), events, ended=True, extra={"junit-family": family})
    parser = etree.XMLParser(huge_tree=True)
    root = etree.fromstring((tmp_path / "junit.xml").read_bytes(), parser)
    if strict:
        SCHEMA.assertValid(root)
        VALIDATOR.validate(json.loads((tmp_path / "result.json").read_bytes()))
    assert root.get("failures") == "1"
    assert results.tests


def test_the_strategies_reach_what_they_are_for():
    """The generated runs contain enough ended tests for the properties to mean something."""
    found = SimpleNamespace(tests=0)

    @settings(max_examples=50, deadline=None, database=None, suppress_health_check=[*HealthCheck])
    @given(runs())
    def count(run: tuple[list[e.Event], bool]) -> None:
        found.tests += sum(isinstance(event, e.TestEnded) for event in run[0])

    count()
    assert found.tests > 20


def test_the_device_under_test_is_in_every_report(tmp_path: Path):
    """Each report has the device's serial number, part and firmware where its format's readers look."""
    device = {"serial": "KA-1041", "part": "left_arm", "firmware": "1.4", "shelf <7>": "B"}
    journal_path = tmp_path / journal.FILE_NAME
    broadcast = Broadcast(journal.Journal(journal_path), [])
    broadcast.emit(e.RunStarted(run="r", version="1", device=device))
    broadcast.emit(e.SuitePlanned(suite="s", name="s"))
    broadcast.emit(e.RunEnded(verdict=Verdict.NOT_RUN, exit_code=5, duration=0.1))
    broadcast.close()
    names = ("junit", "json", "ctrf")
    reporters = [load_reporter(name)(ReportOptions(tmp_path / name, tmp_path)) for name in names]
    for reporter in reporters:
        reporter.open()
    again = Broadcast(None, [*reporters])
    again.replay(journal.read(journal_path))
    again.close()
    properties = etree.parse(tmp_path / "junit").iterfind(".//testsuite/properties/property")
    said = {one.get("name"): one.get("value") for one in properties}
    assert {f"device.{key}": value for key, value in device.items()}.items() <= said.items()
    result = json.loads((tmp_path / "json").read_bytes())
    VALIDATOR.validate(result)
    assert device == result["run"]["device"]
    assert device == json.loads((tmp_path / "ctrf").read_bytes())["results"]["extra"]["rtf"]["run"]["device"]
