"""The history's file: runs are stored whole or not at all, also with several writers and after a kill."""

from __future__ import annotations

import json
import math
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import tracemalloc
from dataclasses import astuple, replace
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from recorded import BEGAN, put, stored
from rtf.testing.events import Event, Measured, RunEnded, RunStarted, TestEnded, TestPlanned, TestStarted, to_line
from rtf.testing.history import History, HistoryError, database
from rtf.testing.history.database import STEPS, import_run, migrate, record_run
from rtf.testing.journal import FILE_NAME
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.results import RunResult
from rtf.testing.verdict import Verdict


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The path of a history that does not exist yet."""
    return tmp_path / "data" / "history.sqlite"


def write_journal(folder: Path, *events: Event) -> Path:
    """Write the journal of a run into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / FILE_NAME).open("wb") as stream:
        stream.writelines(to_line(event) for event in events)
    return folder


def record(path: Path, *events: Event) -> None:
    """Store a run with these events and their results."""
    results = RunResult()
    for event in events:
        results.apply(event)
    with tempfile.TemporaryDirectory() as folder, History(path, create=True) as history:
        record_run(history, write_journal(Path(folder) / "run-1", *events), results)


def started(**more: object) -> RunStarted:
    """Return the event that begins a run."""
    members = {"time": BEGAN, "run": "run-1", "version": "0.1", "robot": "icub01", "station": "bench", **more}
    return RunStarted(**members)


def attempt(test: str, verdict: Verdict, *said: Event, number: int = 1, final: bool = True) -> list[Event]:
    """Return the events of an attempt at a test."""
    ended = TestEnded(test=test, verdict=verdict, outcome=verdict, attempt=number, final=final, duration=0.5)
    return [TestStarted(test=test, attempt=number), *said, ended]


def planned(test: str = "s/t") -> TestPlanned:
    """Return the plan of a test."""
    return TestPlanned(test=test, suite=test.partition("/")[0], name=test.rpartition("/")[2])


def measured(value: float, test: str = "s/t", name: str = "error", **more: object) -> Measured:
    """Return a measurement."""
    return Measured(test=test, name=name, value=value, unit="deg", **more)


def only_run(path: Path) -> tuple:
    """Return the only run of a history, with its tests and measurements."""
    with History(path) as history:
        ((number, run),) = history.runs()
        return run, history.tests(number), history.measurements(number)


# What is kept --------------------------------------------------------------------------------------------------------


def test_a_run_is_kept_with_its_tests_and_measurements(path: Path):
    """Every column has the value of the events."""
    record(
        path,
        started(seed=7, environment={"host": "h", "user": "u"}, command=("--suite", "s.xml")),
        planned(),
        planned("s/never"),
        *attempt("s/t", Verdict.PASSED, measured(1.5, subject="knee", low=0.0, high=2.0, marginal=0.1)),
        RunEnded(time=BEGAN + 9, verdict=Verdict.FAILED, exit_code=1, duration=8.5),
    )
    run, tests, measurements = only_run(path)
    assert (run.run, Path(run.folder).name, run.started, run.ended) == ("run-1", "run-1", BEGAN, BEGAN + 9)
    assert (run.duration, run.verdict, run.exit_code, run.seed) == (8.5, "failed", 1, 7)
    assert (run.robot, run.station, run.version, run.host, run.user) == ("icub01", "bench", "0.1", "h", "u")
    assert json.loads(run.command) == ["--suite", "s.xml"]
    assert tests == [
        ("s/never", "never", "s", "not run", "not run", 0, 0.0, ""),
        ("s/t", "t", "s", "passed", "passed", 1, 0.5, ""),
    ]
    assert measurements == [("s/t", "knee", "error", 0, 1.5, None, "deg", 0.0, 2.0, 0.1, "recorded")]


def test_what_is_measured_again_is_counted(path: Path):
    """Repeated measurements of a subject are numbered in order."""
    said = [measured(3.0), measured(1.0), measured(2.0, subject="knee"), measured(0.0)]
    record(path, started(), planned(), *attempt("s/t", Verdict.PASSED, *said))
    rows = [(row[1], row[3], row[4]) for row in only_run(path)[2]]
    assert rows == [("", 0, 3.0), ("", 1, 1.0), ("", 2, 0.0), ("knee", 0, 2.0)]


def test_of_several_attempts_the_last_counts(path: Path):
    """Of several attempts the last one's measurements are stored, with the number of attempts."""
    record(
        path,
        started(),
        planned(),
        *attempt("s/t", Verdict.FAILED, measured(9.0), measured(8.0), final=False),
        *attempt("s/t", Verdict.FLAKY, measured(1.0), number=2),
    )
    _, tests, measurements = only_run(path)
    assert [row[3:6] for row in tests] == [("flaky", "flaky", 2)]
    assert [row[4] for row in measurements] == [1.0]


def test_the_same_run_again_takes_its_own_place(path: Path):
    """Storing a run again, also after resuming, replaces it."""
    record(path, started(), planned(), *attempt("s/t", Verdict.FAILED, measured(9.0)))
    record(
        path,
        started(),
        started(time=BEGAN + 60, resumed=True),
        planned(),
        *attempt("s/t", Verdict.PASSED, measured(1.0)),
    )
    _, tests, measurements = only_run(path)
    assert tests[0][3] == "passed"
    assert [row[4] for row in measurements] == [1.0]


@pytest.mark.parametrize("other", [{"run": "run-2"}, {"time": BEGAN + 1}, {"station": "field"}])
def test_other_runs_have_places_of_their_own(path: Path, other: dict[str, object]):
    """A run is identified by folder name, start and station."""
    record(path, started())
    record(path, started(**other))
    with History(path) as history:
        assert len(history.runs()) == 2


def test_a_run_that_has_not_begun_leaves_nothing(path: Path):
    """A run without events is not stored."""
    record(path)
    with History(path) as history:
        assert history.runs() == []


def test_any_sqlite_tool_reads_it(path: Path):
    """The file is a consistent SQLite database with plain tables and a version."""
    record(path, started(), planned(), *attempt("s/t", Verdict.PASSED, measured(1.5)))
    with sqlite3.connect(path) as plain:
        query = "SELECT r.robot, m.value FROM measurements m JOIN runs r ON r.id = m.run WHERE m.name = 'error'"
        assert plain.execute(query).fetchall() == [("icub01", 1.5)]
        assert plain.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert plain.execute("PRAGMA foreign_key_check").fetchall() == []
        assert plain.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert plain.execute("PRAGMA user_version").fetchone() == (len(STEPS),)
    plain.close()


TEXT = st.text(st.characters(), max_size=6) | st.text(st.characters(categories=["Cs", "Cc"]), max_size=4)


@settings(max_examples=30, deadline=None)
@example(("\ud800\udc00", "", "", ""), [("", "\ud800", 0.0, None, MeasurementVerdict.PASSED)])
@given(
    st.tuples(TEXT, TEXT, TEXT, TEXT),
    st.lists(st.tuples(TEXT, TEXT, st.floats(), st.none() | st.floats(), st.sampled_from(MeasurementVerdict))),
)
def test_whatever_is_measured_comes_out_again(names: tuple[str, ...], values: list):
    """Any text and number is stored exactly; NaN by name, surrogates replaced."""
    test, robot, station, run = names
    said = [
        Measured(test=test, name=name, subject=subject, value=value, low=low, verdict=verdict, unit=name)
        for name, subject, value, low, verdict in values
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "h.sqlite"
        begun = started(run=run, robot=robot, station=station)
        for _ in range(2):
            record(path, begun, planned(test), *attempt(test, Verdict.PASSED, *said))
        with History(path) as history:
            ((number, found),) = history.runs()
            rows = history.measurements(number)
    assert _readable(found.robot) == _readable(robot)
    keyed = {(subject, name) for name, subject, *_ in values}
    assert {row[1:3] for row in rows} >= {key for key in keyed if key == tuple(map(_readable, key))}
    expected = sorted(str(value + 0.0) for _, _, value, _, _ in values)  # SQLite keeps no sign of a zero
    words = {"NaN": "nan", "Infinity": "inf", "-Infinity": "-inf"}
    assert sorted(words[row[5]] if row[4] is None else str(row[4]) for row in rows) == expected
    assert all(row[7] is None or math.isfinite(row[7]) for row in rows)


def _readable(text: str) -> str:
    joined = text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "surrogatepass")
    return joined.encode("utf-8", "backslashreplace").decode()


def test_a_megabyte_in_every_text_is_kept(path: Path):
    """Texts of a megabyte are stored whole."""
    long = "x\x1b\0" + "y" * 1_000_000
    record(
        path,
        started(run=long, robot=long),
        planned("s/" + long),
        *attempt("s/" + long, Verdict.PASSED, measured(1.0, test="s/" + long, name=long, subject=long)),
    )
    run, tests, measurements = only_run(path)
    assert (run.robot, tests[0][1], measurements[0][2]) == (long, long, long)


def test_an_archived_run_is_put_in_as_it_was_at_its_end(path: Path, tmp_path: Path):
    """A run is imported from its journal; what was running when it was killed is interrupted."""
    events = [started(), planned(), planned("s/u"), *attempt("s/t", Verdict.PASSED, measured(1.0))]
    events += [TestStarted(test="s/u"), measured(2.0, test="s/u")]
    with History(path, create=True) as history:
        results = import_run(history, write_journal(tmp_path / "run-1", *events))
    run, tests, measurements = only_run(path)
    assert (run.verdict, run.folder) == ("interrupted", str(tmp_path / "run-1"))
    assert [row[3] for row in tests] == ["passed", "interrupted"] == [test.verdict for test in results.tests.values()]
    assert [row[4] for row in measurements] == [1.0, 2.0]


def test_memory_does_not_grow_with_the_run(path: Path, tmp_path: Path):
    """Importing twenty thousand measurements, which are 5 MB of objects, takes 2 MB at most."""
    said = [measured(number, name=f"error {number % 100}") for number in range(20_000)]
    run = write_journal(tmp_path / "run-1", started(), planned(), *attempt("s/t", Verdict.PASSED, *said))
    del said
    with History(path, create=True) as history:
        tracemalloc.start()
        import_run(history, run)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < 2_000_000


# Several writers, and what dies --------------------------------------------------------------------------------------

WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[3])
from recorded import put, stored
from rtf.testing.measurement import Measurement
for index in range(10):
    values = {("s/t", "", f"error {n}"): Measurement("error", float(n)) for n in range(50)}
    put(Path(sys.argv[1]), stored(index, station=sys.argv[2]), {"s/t": "passed"}, values)
"""

HALF = """
import signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from recorded import stored
from rtf.testing.history import History
def rows():
    for number in range(20_000):
        yield ("s/t", "x" * 300, "error", number, 1.0, None, "", None, None, None, "recorded")
    print("half", flush=True)
    signal.pause()
with History(Path(sys.argv[1])) as history:
    history.record(stored(1), [("s/t", "t", "s", "passed", "passed", 1, 0.0, "", 0.0, None)], rows())
"""

TESTS = str(Path(__file__).parents[1])


def test_several_testrunners_write_at_once(path: Path):
    """Several runners can create and write the file at the same time."""
    arguments = [[sys.executable, "-c", WRITER, str(path), f"station {number}", TESTS] for number in range(4)]
    writers = [subprocess.Popen(words) for words in arguments]
    assert [writer.wait(60) for writer in writers] == [0, 0, 0, 0]
    with History(path) as history:
        runs = history.runs()
        assert len(runs) == 40
        assert {len(history.measurements(number)) for number, _ in runs} == {50}


def test_a_writer_killed_in_the_middle_leaves_no_half_run(path: Path):
    """A killed writer leaves no part of its run, and the next one can write at once."""
    put(path, stored(0), {"s/t": Verdict.PASSED})
    with subprocess.Popen([sys.executable, "-c", HALF, str(path), TESTS], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "half\n"
        assert path.with_name(f"{path.name}-wal").stat().st_size > 1_000_000
        writer.send_signal(signal.SIGKILL)
    put(path, stored(2), {"s/t": Verdict.PASSED})
    with History(path) as history:
        assert [run.run for _, run in history.runs()] == ["run-2", "run-0"]
    with sqlite3.connect(path) as plain:
        assert plain.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    plain.close()


def test_readers_do_not_wait_for_a_writer(path: Path):
    """Readers see the former state while a writer is at work."""
    put(path, stored(0))
    writer = sqlite3.connect(path, isolation_level=None)
    writer.execute("BEGIN IMMEDIATE")
    writer.execute("DELETE FROM runs")
    with History(path) as history:
        assert len(history.runs()) == 1
        history.check_writable()  # another one at work is no reason to refuse a run
    writer.close()


def test_a_file_that_stays_locked_is_reported(path: Path, monkeypatch: pytest.MonkeyPatch):
    """A file that stays locked is an error with a hint."""
    monkeypatch.setattr(database, "_PATIENCE", 0.05)
    put(path, stored(0))
    writer = sqlite3.connect(path, isolation_level=None)
    writer.execute("BEGIN IMMEDIATE")
    with pytest.raises(HistoryError, match=r"history\.sqlite: database is locked; another program holds it"):
        put(path, stored(1))
    writer.close()


# Files that are not what they should be ------------------------------------------------------------------------------


def test_a_file_that_is_not_there_is_made_only_for_writing(path: Path):
    """Reading a missing history is an error with a hint, and makes no file."""
    with pytest.raises(HistoryError, match=r"there is no history .* yet: run tests with --history"):
        History(path)
    assert not path.parent.exists()


@pytest.mark.parametrize("content", [b"no database" * 100, b"SQLite format 3\0" + os.urandom(8000)])
def test_a_damaged_file_is_refused_and_left_alone(tmp_path: Path, content: bytes):
    """A damaged file is refused with a hint, and not changed."""
    path = tmp_path / "h.sqlite"
    path.write_bytes(content)
    for create in (True, False):
        with pytest.raises(HistoryError, match=r"h\.sqlite: .*(move it away|--history FILE)"):
            History(path, create=create)
    assert path.read_bytes() == content


def test_damage_inside_is_reported(path: Path):
    """A damaged page is an error with a hint."""
    for index in range(50):
        put(path, stored(index), {f"s/{n}": Verdict.PASSED for n in range(50)})
    data = bytearray(path.read_bytes())
    data[4096 * 3 : 4096 * 20] = b"\xff" * (4096 * 17)
    path.write_bytes(data)

    def read_all() -> None:
        with History(path) as history:
            for number, _ in history.runs():
                history.tests(number)

    with pytest.raises(HistoryError, match="makes it anew from archived runs"):
        read_all()


@pytest.mark.parametrize("create", [True, False])
def test_a_newer_version_is_refused(path: Path, create: bool):
    """A file of a newer version is refused."""
    put(path, stored(0))
    plain = sqlite3.connect(path)
    plain.execute(f"PRAGMA user_version = {len(STEPS) + 1}")
    plain.close()
    with pytest.raises(HistoryError, match=f"it is of version {len(STEPS) + 1}, and this RTF knows {len(STEPS)}; use"):
        History(path, create=create)


def test_a_database_of_something_else_is_refused_and_left_alone(tmp_path: Path):
    """Another program's database is refused, and not changed."""
    path = tmp_path / "places.sqlite"
    plain = sqlite3.connect(path)
    plain.execute("CREATE TABLE places (url)")
    plain.commit()
    plain.close()
    content = path.read_bytes()
    with pytest.raises(HistoryError, match="it is a database of something else; name another file"):
        History(path, create=True)
    assert path.read_bytes() == content


def test_an_empty_file_becomes_a_history(tmp_path: Path):
    """An empty file, such as of ``mktemp``, is made a history."""
    path = tmp_path / "h.sqlite"
    path.touch()
    put(path, stored(0))
    with History(path) as history:
        assert history.runs() == [(1, stored(0))]


def test_ids_of_an_older_version_are_renewed(path: Path):
    """Ids of an older version are translated into present ones, with their values."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = sqlite3.connect(path)
    migrate(plain, STEPS[:1])
    run = (1, "run-1", "/r", BEGAN, None, None, "passed", 0, "icub01", "bench", "0.1", None, "h", "u", "[]")
    plain.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(run))})", run)
    names = {"s/jointlimits-left_arm": "JointLimits [left_arm]", "s/nod~2": "Nod", "s/left-arm": "said by the test"}
    for test, name in names.items():
        plain.execute("INSERT INTO tests VALUES (1, ?, ?, 's', 'passed', 'passed', 1, 0.5, '')", (test, name))
        row = (test, "j0", "reached", 0, 1.5, None, "deg", None, 2.0, None, "passed")
        plain.execute("INSERT INTO measurements VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
    plain.commit()
    plain.close()
    ids = ["s/JointLimits[left_arm]", "s/Nod+2", "s/left-arm"]
    with History(path) as history:
        assert [row[0] for row in history.tests(1)] == ids
        assert [(row[0], row[4]) for row in history.measurements(1)] == [(test, 1.5) for test in ids]


def test_an_older_version_is_brought_up_to_date(path: Path, monkeypatch: pytest.MonkeyPatch):
    """An older file is migrated with its contents; a failed step leaves it unchanged."""
    put(path, stored(0), {"s/t": Verdict.PASSED})
    monkeypatch.setattr(database, "STEPS", (*STEPS, ("CREATE TABLE notes (run)", "no SQL")))
    with pytest.raises(HistoryError):
        History(path)
    monkeypatch.setattr(database, "STEPS", (*STEPS, ("CREATE TABLE notes (run)",)))
    with History(path) as history:
        assert history.runs() == [(1, stored(0))]
    plain = sqlite3.connect(path)
    assert plain.execute("SELECT * FROM notes").fetchall() == []
    assert plain.execute("PRAGMA user_version").fetchone() == (len(STEPS) + 1,)
    migrate(plain, (*STEPS, ("CREATE TABLE notes (run)",)))  # nothing is left to be done
    plain.close()


# Care ----------------------------------------------------------------------------------------------------------------


def test_pruning_keeps_the_newest_of_each_robot_and_station(path: Path):
    """Pruning keeps the newest runs of each robot and station, and frees the space of the others."""
    for index in range(6):
        put(path, stored(index), {f"s/{n}": Verdict.PASSED for n in range(500)})
    put(path, stored(0, station="field"))
    size = path.stat().st_size
    with History(path) as history:
        assert history.prune(2) == 4
        kept = {(run.station, run.run) for _, run in history.runs()}
        assert history.prune(2) == 0
    assert kept == {("bench", "run-5"), ("bench", "run-4"), ("field", "run-0")}
    assert path.stat().st_size < size / 2
    plain = sqlite3.connect(path)
    assert plain.execute("SELECT count(*) FROM tests").fetchone() == (1000,)
    plain.close()


def test_a_run_is_forgotten_by_its_name(path: Path):
    """Forgetting a run removes its tests and measurements."""
    put(path, stored(0), {"s/t": Verdict.PASSED})
    put(path, stored(1), {"s/t": Verdict.PASSED})
    with History(path) as history:
        assert (history.forget("run-0"), history.forget("run-0")) == (1, 0)
        assert [run.run for _, run in history.runs()] == ["run-1"]
        assert history.tests(1) == []


def test_robots_and_stations_are_asked_for_by_name_or_pattern(path: Path):
    """Robots and stations are selected by name or pattern, also names that look like patterns."""
    for index, robot in enumerate(["icub01", "icub02", "[r1]", ""]):
        put(path, stored(index, robot=robot))
    with History(path) as history:
        for robot, number in {"icub01": 1, "icub0?": 2, "*": 4, "[r1]": 1, "": 1, "nobody": 0}.items():
            assert len(history.runs(robot)) == number
        assert history.runs("*", "field") == []


def test_the_columns_are_those_of_the_class(path: Path):
    """A stored run is read with the same fields."""
    run = replace(stored(3), seed=5, ended=None, duration=None, command='["a"]')
    put(path, run)
    assert astuple(only_run(path)[0]) == astuple(run)
