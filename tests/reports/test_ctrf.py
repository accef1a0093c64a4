"""Tests of the CTRF reporter: valid by the specification, and correct about retries and about fixtures."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import jsonschema

from rtf.testing.events import Attached, Measured, OutputCaptured, ParametersResolved, SubResultEnded
from rtf.testing.verdict import FixtureState, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pytest

    from rtf.testing.events import Message
    from tests.reports.conftest import Reports, Story

TEXT = {"type": "string"}
WHOLE = {"type": "integer"}
LINES = {"type": "array", "items": TEXT}
NAME = {"type": "string", "minLength": 1}
UUID = {"type": "string", "pattern": "^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$"}
STATUS = {"enum": ["passed", "failed", "skipped", "pending", "other"]}


def shape(required: dict[str, Any], optional: dict[str, Any] | None = None):
    """Return the schema of an object with these members and no others."""
    properties = {**required, **(optional or {}), "extra": {"type": "object"}}
    return {"type": "object", "required": [*required], "properties": properties, "additionalProperties": False}


FILES = {"type": "array", "items": shape({"name": TEXT, "contentType": TEXT, "path": TEXT})}
TIMES = {"start": WHOLE, "stop": WHOLE}
ATTEMPT = shape(
    {"attempt": {"type": "integer", "minimum": 1}, "status": STATUS},
    {
        "duration": WHOLE,
        "message": TEXT,
        "trace": TEXT,
        "stdout": LINES,
        "stderr": LINES,
        "attachments": FILES,
        **TIMES,
    },
)
TEST = shape(
    {"name": NAME, "status": STATUS, "duration": WHOLE},
    {
        "id": UUID,
        "suite": {**LINES, "minItems": 1},
        "message": TEXT,
        "trace": TEXT,
        "line": WHOLE,
        "rawStatus": TEXT,
        "tags": LINES,
        "type": TEXT,
        "filePath": TEXT,
        "retries": WHOLE,
        "retryAttempts": {"type": "array", "items": ATTEMPT},
        "flaky": {"type": "boolean"},
        "stdout": LINES,
        "stderr": LINES,
        "attachments": FILES,
        "parameters": {"type": "object"},
        "steps": {"type": "array", "items": shape({"name": TEXT, "status": STATUS})},
        **TIMES,
    },
)
COUNTS = dict.fromkeys(("tests", "passed", "failed", "skipped", "pending", "other", "start", "stop"), WHOLE)
#: The part of the specification's schema, version 0.1.0, that the reporter uses.
SCHEMA = shape(
    {
        "reportFormat": {"const": "CTRF"},
        "specVersion": {"const": "0.1.0"},
        "results": shape(
            {
                "tool": shape({"name": NAME}, {"version": TEXT}),
                "summary": shape(COUNTS, {"flaky": WHOLE, "suites": WHOLE, "duration": WHOLE}),
                "tests": {"type": "array", "items": TEST},
            },
            {"environment": shape({}, {"testEnvironment": TEXT})},
        ),
    },
    {"reportId": UUID, "timestamp": TEXT, "generatedBy": TEXT},
)


def read(path: Path):
    """Return the results of a document, after checking the document and its counts."""
    document = json.loads(path.read_bytes())
    jsonschema.validate(document, SCHEMA)
    results = document["results"]
    for status in STATUS["enum"]:
        assert results["summary"][status] == sum(test["status"] == status for test in results["tests"])
    return results


def test_verdicts_become_statuses(story: Story, reports: Reports):
    """Each of the thirteen verdicts has one of CTRF's five statuses, and its own word in ``rawStatus``."""
    story.begin(("arm", len(Verdict))).start("arm")
    for number, verdict in enumerate(Verdict, 1):
        story.test(f"arm/t{number}", verdict, detail="why")
    statuses = {test["rawStatus"]: test["status"] for test in read(reports("ctrf", story.end("arm").finish()))["tests"]}
    assert {"passed", "measured", "flaky"} == {raw for raw, status in statuses.items() if status == "passed"}
    assert tuple(statuses[raw] for raw in ("skipped", "blocked", "not run", "expected failure")) == (
        "skipped",
        "skipped",
        "pending",
        "other",
    )
    bad = {"failed", "error", "inconclusive", "unexpected pass", "fixture lost", "interrupted"}
    assert bad == {raw for raw, status in statuses.items() if status == "failed"}


def test_retries_are_what_came_before_the_last_attempt(
    story: Story, reports: Reports, check_failed: Callable[..., Message]
):
    """The last attempt is the test itself, and the earlier ones are its retries, as CTRF says since 0.0.4."""
    story.begin(("arm", 1)).start("arm")
    said = [check_failed("arm/t1", "slipped"), OutputCaptured(stream="stdout", text="a\nb\n", test="arm/t1")]
    story.test("arm/t1", Verdict.FAILED, *said, final=False, detail="slipped")
    story.test("arm/t1", Verdict.FLAKY, outcome=Verdict.PASSED, attempt=2, duration=1.25).end("arm").finish()
    (test,) = read(reports("ctrf", story))["tests"]
    (attempt,) = test["retryAttempts"]
    assert (test["status"], test["flaky"], test["retries"], test["duration"]) == ("passed", True, 1, 1250)
    assert tuple(attempt[name] for name in ("attempt", "status", "message", "stdout")) == (
        1,
        "failed",
        "slipped",
        ["a", "b"],
    )
    assert "reach.py:12" in attempt["trace"]


def test_what_the_format_has_words_for_is_said_in_them(
    story: Story, reports: Reports, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Parameters, parts and files use CTRF's own members; measurements are below ``extra``."""
    monkeypatch.chdir(tmp_path)
    said = [
        ParametersResolved(test="arm/t1", parameters=({"name": "speed", "value": "3", "unit": "", "source": "x"},)),
        SubResultEnded(test="arm/t1", subject="joint 3", verdict=Verdict.PASSED),
        Attached(test="arm/t1", name="a.png", path="files/a.png", media_type="image/png"),
        Measured(test="arm/t1", name="reach", value=3.0, unit="deg"),
    ]
    story.begin(("arm", 1)).start("arm").test("arm/t1", Verdict.PASSED, *said).end("arm").finish()
    (test,) = read(reports("ctrf", story))["tests"]
    assert test["parameters"] == {"speed": "3"}
    assert test["steps"] == [{"name": "joint 3", "status": "passed"}]
    assert test["attachments"] == [{"name": "a.png", "contentType": "image/png", "path": "files/a.png"}]
    assert tuple(test["extra"]["rtf"]["measurements"][0][name] for name in ("name", "value")) == ("reach", 3.0)
    assert test["suite"] == ["arm"]


def test_a_case_of_a_program_names_its_program(story: Story, reports: Reports):
    """The suites of a case are its suite and its program, whether the case has run or not."""
    story.begin(("arm", 1)).add(story.planned("arm", "t1::a", parent="arm/t1", case="a"))
    story.add(story.planned("arm", "t1::b", parent="arm/t1", case="b"))
    story.start("arm").test("arm/t1").test("arm/t1::a", Verdict.FAILED)
    results = read(reports("ctrf", story.end("arm").finish()))
    assert {test["name"]: test["suite"] for test in results["tests"]} == {
        "t1": ["arm"],
        "t1::a": ["arm", "t1"],
        "t1::b": ["arm", "t1"],
    }


def test_a_fixture_that_was_given_up_is_a_failed_test(story: Story, reports: Reports):
    """A fixture that was given up is a failed test, for the tests that it blocked are only skipped."""
    story.begin(("arm", 1)).start("arm").incident("arm", "sim").fixture("arm", "sim", FixtureState.FAILED)
    story.test("arm/t1", Verdict.BLOCKED, attempt=0).end("arm", Verdict.FAILED).finish()
    results = read(reports("ctrf", story))
    assert [(t["name"], t["status"]) for t in results["tests"]] == [("t1", "skipped"), ("fixture: sim", "failed")]


def test_a_fixture_that_came_back_fails_nothing(story: Story, reports: Reports):
    """A fixture that was restarted is a test with the status ``other``, which fails nothing."""
    story.begin(("arm", 1)).start("arm").incident("arm", "sim").fixture("arm", "sim", FixtureState.READY, 2)
    results = read(reports("ctrf", story.test("arm/t1").end("arm").finish()))
    assert [(t["name"], t["status"]) for t in results["tests"]] == [("t1", "passed"), ("fixture: sim", "other")]
