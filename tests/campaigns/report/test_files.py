"""The files of a report: JSON, tables and page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.campaigns import Measured, Outcome
from rtf.campaigns.report.files import to_json, write_json, write_page, write_tables
from rtf.campaigns.report.summary import Report, make_report, severity_unit
from rtf.testing.verdict import Verdict
from simulated_truth import Truth, faulty, measured, outcome

if TYPE_CHECKING:
    from pathlib import Path

OUTCOMES = [
    *Truth().campaign(np.random.default_rng(1), [0.5, 1.0, 2.0, 4.0], 20),
    *measured(np.random.default_rng(2).normal(1.0, 0.1, 30), None, 1.3),
    faulty(None, found=True, fault="motor_sign"),
]
HOSTILE = '=1+1<script>alert("x")</script>\ud800,\n'


@pytest.fixture(scope="module")
def report() -> Report:
    """The report of the outcomes."""
    return make_report(OUTCOMES, "lab")


def test_a_report_knows_the_units_of_faults(report: Report):
    """A severity is in the unit of the first parameter of its kind; a kind that is not known here has none."""
    assert report.detection[0].unit == "deg/s"
    assert severity_unit("a_fault_of_a_friend") == ""


def test_json_has_all_of_it(report: Report, tmp_path: Path):
    """It is what the dataclasses are, with null for what is no finite number."""
    write_json(tmp_path / "new" / "report.json", report)
    found = json.loads((tmp_path / "new" / "report.json").read_bytes())
    assert found["size"]["runs"] == len(OUTCOMES)
    assert found["detection"][0]["limit"]["severity"] == report.detection[0].limit.severity
    assert len(found["detection"][0]["points"]) == len(report.detection[0].points)
    assert json.loads(to_json(Measured(float("inf"), "deg"))) == {
        "value": None,
        "unit": "deg",
        "lower": None,
        "upper": None,
    }


def test_pandas_reads_a_table_in_one_line(report: Report, tmp_path: Path):
    """Rows and types are there; what is none is missing."""
    import pandas as pd  # here, as each process that collects tests would load it

    write_tables(tmp_path, report, OUTCOMES)
    runs = pd.read_csv(tmp_path / "runs.csv")
    assert len(runs) == len(OUTCOMES)
    shares = runs[runs.fault == "encoder_drift"].groupby("severity").verdict.apply(lambda one: (one == "failed").mean())
    assert shares.to_list() == [level.found.share for level in report.detection[0].levels]
    assert runs.severity.isna().sum() == 31
    values = pd.read_csv(tmp_path / "measurements.csv")
    assert values.value.to_numpy() == pytest.approx(
        [one.measurements["l_elbow/error"].value for one in OUTCOMES[80:110]]
    )
    assert set(values.unit_of_value) == {"deg"}
    limits = pd.read_csv(tmp_path / "detection.csv")
    assert limits["limit.severity"][0] == pytest.approx(report.detection[0].limit.severity)
    names = {path.stem for path in tmp_path.iterdir()}
    assert names == {
        "alarms", "choices", "costs", "detection", "distributions", "flakiness", "levels", "measurements", "runs",
    }  # fmt: skip


def test_hostile_texts_stay_texts(tmp_path: Path):
    """They end no element of the page, are no formula of a spreadsheet, and keep no file from being written."""
    import pandas as pd

    outcomes = [outcome(test=HOSTILE, measurements={HOSTILE: Measured(1.0)}), faulty(1.0, found=True, test=HOSTILE)]
    report = make_report(outcomes, HOSTILE)
    write_tables(tmp_path, report, outcomes)
    write_page(tmp_path / "page.html", report)
    write_json(tmp_path / "report.json", report)
    assert b"alert(" not in (tmp_path / "page.html").read_bytes()
    first = pd.read_csv(tmp_path / "runs.csv").test[0]
    assert first.startswith("'=1+1<script>")
    assert json.loads((tmp_path / "report.json").read_bytes())["name"].startswith("=1+1<script>")


@given(
    st.lists(
        st.builds(
            outcome,
            st.sampled_from(Verdict),
            test=st.sampled_from(["A", "B"]),
            unit=st.integers(0, 2),
            fault=st.sampled_from([None, "jam", "motor_sign"]),
            severity=st.one_of(st.none(), st.floats(allow_nan=False, allow_infinity=False)),
            named=st.sampled_from([None, "l_elbow"]),
            joint=st.sampled_from([None, "l_elbow"]),
            seconds=st.floats(0.0, 1e6),
            measurements=st.dictionaries(
                st.sampled_from(["x", "y"]),
                st.builds(
                    Measured,
                    st.floats(),
                    st.just("deg"),
                    st.one_of(st.none(), st.floats(allow_nan=False)),
                    st.one_of(st.none(), st.floats(allow_nan=False)),
                ),
            ),
        ),
        max_size=12,
    )
)
def test_any_outcomes_have_a_report(outcomes: list[Outcome]):
    """Also none at all, and numbers of any size: no error, and strict JSON."""
    json.loads(to_json(make_report(outcomes, "any")))
