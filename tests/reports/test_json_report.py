"""Tests of the JSON report: complete, described by its schema, and written while the run goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest

from rtf.testing import plugins
from rtf.testing.events import (
    Answered,
    Asked,
    Attached,
    Diagnosed,
    InternalError,
    Interrupted,
    Measured,
    Message,
    OutputCaptured,
    ParametersResolved,
    PhaseStarted,
    SeriesRecorded,
    StackDumped,
    SubResultEnded,
    TestRenamed,
)
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict
from tests.waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from jsonschema import Draft202012Validator

    from tests.reports.conftest import Reports, Story


def strict(schema: Any):
    """Return the schema with every object closed, so that it must know each member that the reporter writes."""
    if isinstance(schema, dict):
        closed = {name: strict(member) for name, member in schema.items()}
        return closed | {"additionalProperties": False} if "properties" in closed else closed
    return [strict(item) for item in schema] if isinstance(schema, list) else schema


@pytest.fixture(scope="session")
def validator():
    """A validator of the schema that RTF ships."""
    schema = json.loads((plugins.shipped_folder("report") / "result.schema.json").read_bytes())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(strict(schema))


def refuse(word: str):
    """Fail for the numbers that JSON lacks."""
    raise AssertionError(word)


def read(path: Path, validator: Draft202012Validator):
    """Return the document, after checking that it is strict JSON and fits the schema."""
    document = json.loads(path.read_bytes(), parse_constant=refuse)
    validator.validate(document)
    return document


def everything(story: Story, check_failed: Callable[..., Message]):
    """A story with every event that a report can have."""
    said = [
        PhaseStarted(test="arm/t1", phase=Phase.RUN, repetition=1, limit=300.0),
        ParametersResolved(test="arm/t1", parameters=({"name": "n", "value": "3", "unit": "deg", "source": "ini"},)),
        Message(severity=Severity.INFO, title="reports", detail="moving", test="arm/t1", value=float("nan")),
        check_failed("arm/t1", subject="joint 1", phase=Phase.RUN, value=3.0, low=1.0, high=2.0, margin=-1.0),
        Measured(
            test="arm/t1",
            name="reach",
            value=float("inf"),
            unit="deg",
            low=1.0,
            high=2.0,
            marginal=0.1,
            margin=float("-inf"),
            verdict=MeasurementVerdict.FAILED,
            subject="joint 1",
        ),
        SeriesRecorded(test="arm/t1", name="q", path="files/q.npz", columns=({"name": "t", "unit": "s"},), rows=9),
        SubResultEnded(test="arm/t1", subject="joint 1", verdict=Verdict.FAILED, reason="too far", duration=0.1),
        Attached(test="arm/t1", name="a.png", path="files/a.png", media_type="image/png", size=3),
        Asked(test="arm/t1", question="q1", text="Is it up?", choices=("yes", "no"), default="yes"),
        Answered(test="arm/t1", question="q1", answer="yes", source="console"),
        OutputCaptured(stream="stdout", text="noise\n", test="arm/t1", omitted=3),
        StackDumped(text="Thread 1", cause="hung", test="arm/t1"),
        TestRenamed(test="arm/t1", name="reach all", description="reaches"),
    ]
    story.begin(("arm", 2), fixtures=("sim",))
    story.add(Diagnosed(severity=Severity.WARNING, text="odd", file="a.xml", line=1, column=2, hint="mend", suite="x"))
    story.start("arm").fixture("arm", "sim", FixtureState.STARTING).fixture("arm", "sim", FixtureState.READY)
    story.add(OutputCaptured(stream="stderr", text="up\n", fixture="sim", suite="arm"))
    story.add(Message(severity=Severity.INFO, title="reports", fixture="sim", suite="arm"))
    story.add(
        Message(severity=Severity.INFO, title="reports", suite="arm"), StackDumped(text="x", cause="y", fixture="sim")
    )
    story.test("arm/t1", Verdict.FAILED, *said, final=False, detail="too far", exit_status=0, signal="", cpu_time=0.1)
    story.incident("arm", "sim", exit_status=139, test="arm/t1", traceback="trace")
    story.fixture("arm", "sim", FixtureState.STARTING, 2).test(
        "arm/t1", Verdict.FLAKY, outcome=Verdict.PASSED, attempt=2
    )
    story.end("arm").fixture("arm", "sim", FixtureState.STOPPED, 2).add(Interrupted(source="SIGINT", stage=1))
    return story.add(InternalError(text="broke", traceback="trace")).finish()


def test_everything_that_was_said_is_in_the_record(
    story: Story, reports: Reports, check_failed: Callable[..., Message], validator: Draft202012Validator
):
    """The report has every event's content under the schema's names, in order, with what follows the end of a suite."""
    document = read(reports("json", everything(story, check_failed)), validator)
    (suite,) = document["suites"]
    (fixture,) = suite["fixtures"]
    first, second = suite["tests"]
    assert (
        document["format"],
        document["version"],
        document["run"]["robot"],
        document["run"]["interrupted"] and "interrupted",
    ) == ("rtf-result", 2, "icubSim", "interrupted")
    assert (
        first["name"],
        first["description"],
        first["verdict"],
        len(first["attempts"]),
    ) == ("reach all", "reaches", "flaky", 2)
    attempt = first["attempts"][0]
    empty = [name for name, value in attempt.items() if value == []]
    assert empty == []
    assert [message["value"] for message in attempt["messages"]] == ["NaN", 3.0]
    assert (attempt["measurements"][0]["value"], attempt["measurements"][0]["margin"]) == ("Infinity", "-Infinity")
    assert (second["verdict"], second["attempts"]) == ("not run", [])
    assert [life["generation"] for life in fixture["generations"]] == [1, 2]
    assert [state["state"] for state in fixture["generations"][1]["states"]] == ["starting", "stopped"]
    assert (fixture["incidents"][0]["exit_status"], fixture["incidents"][0]["test"]) == (139, "arm/t1")
    assert [output["text"] for output in fixture["output"]] == ["up\n"]
    assert [event["text"] for event in document["diagnostics"]] == ["odd"]


def test_a_test_that_was_running_when_the_journal_stopped_is_reported(
    story: Story, reports: Reports, check_failed: Callable[..., Message], validator: Draft202012Validator
):
    """A test that was running when the journal stopped has an attempt without outcome, with its messages."""
    story.begin(("arm", 1)).start("arm").failing("arm/t1")
    del story.events[-1]
    (test,) = read(reports("json", story), validator)["suites"][0]["tests"]
    assert (test["attempts"][0]["outcome"], len(test["attempts"][0]["messages"])) == (None, 1)


def test_a_test_that_is_run_again_keeps_its_earlier_attempts(
    story: Story, reports: Reports, validator: Draft202012Validator
):
    """A test that a resumed run runs again keeps its interrupted attempt."""
    story.begin(("arm", 1)).start("arm").test("arm/t1", Verdict.INTERRUPTED).test("arm/t1").end("arm").finish()
    (test,) = read(reports("json", story), validator)["suites"][0]["tests"]
    assert [attempt["outcome"] for attempt in test["attempts"]] == ["interrupted", "passed"]


def test_it_goes_to_standard_output_without_a_target(
    story: Story, reports: Reports, capfdbinary: pytest.CaptureFixture[bytes]
):
    """Without a target the report goes to standard output, as one document and nothing else."""
    reports("json", story.begin(("arm", 1)).start("arm").test("arm/t1").end("arm").finish(), target=None)
    assert json.loads(capfdbinary.readouterr().out)["format"] == "rtf-result"


def test_a_report_is_whole_or_not_there(story: Story, reports: Reports):
    """The report replaces an old file in one step, also while the run goes on, and leaves no other file."""
    old = reports.folder / "result.json"
    old.write_text("old")
    reports("json", story.begin(("arm", 2)).start("arm").test("arm/t1"), close=False)

    def verdicts() -> list[str]:
        text = old.read_text()
        return [] if text == "old" else [test["verdict"] for test in json.loads(text)["suites"][0]["tests"]]

    eventually(lambda: verdicts() == ["passed", "not run"], "the report is not written while the run goes on")
    reports.broadcast.close()
    assert [old] == [*reports.folder.iterdir()]


def test_a_folder_that_does_not_exist_is_made(story: Story, reports: Reports):
    """The reporter makes the folders of its target."""
    target = reports.folder / "new" / "er" / "result.json"
    assert reports("json", story, target=target).is_file()
