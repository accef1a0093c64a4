"""The archive of a run: complete, one run, limited in size, and without foreign markup."""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from archives import BLOCK, blocks, put
from rtf.page import archive
from rtf.page.archive import Extras, write_archive
from rtf.page.single_file import write_block
from rtf.testing.events import (
    Asked,
    Attached,
    Message,
    RunEnded,
    RunStarted,
    SeriesRecorded,
    SeriesSampled,
    TestEnded,
    TestStarted,
    to_line,
)
from rtf.testing.journal import FILE_NAME, JournalError
from rtf.testing.verdict import Severity, Verdict

STARTED = RunStarted(run="run-1", version="1", time=1.0, seq=1)
ENDED = RunEnded(verdict=Verdict.PASSED, exit_code=0, duration=1.0, time=9.0, seq=9)


def archived(folder: Path, extras: Extras | None = None) -> dict[str, bytes]:
    """Return the blocks of the archive of a run's folder."""
    stream = io.BytesIO()
    write_archive(stream, folder, extras)
    return blocks(stream.getvalue())


def facts(found: dict[str, bytes]) -> dict[str, Any]:
    """Return the facts of the page."""
    return json.loads(found['id="rtf-facts"'])


def left_out(found: dict[str, bytes]) -> dict[str, str]:
    """Return the reasons of omitted files by path."""
    return {str(row["path"]): str(row["reason"]) for row in facts(found)["left_out"]}


def attached(path: str, **more: Any) -> Attached:
    """Return the event of an attachment."""
    return Attached(test="s/t", name=path, path=path, **more)


def series(path: str, rows: int, **more: Any) -> SeriesRecorded:
    """Return the event of a series of two columns."""
    return SeriesRecorded(
        test="s/t",
        name="x",
        path=path,
        columns=({"name": "t", "unit": "s"}, {"name": "x", "unit": ""}),
        rows=rows,
        **more,
    )


def test_the_journal_of_a_whole_run_is_put_in_as_it_is(tmp_path: Path):
    """A complete journal is archived byte by byte, unknown events included."""
    unknown = b'{"event":"from the future","time":3,"more":[1]}\n'
    folder = put(tmp_path, STARTED)
    with (folder / FILE_NAME).open("ab") as stream:
        stream.write(unknown + to_line(ENDED))
    found = archived(folder)
    assert found['id="rtf-journal"'] == (folder / FILE_NAME).read_bytes()
    assert facts(found) == {
        "mode": "archive",
        "control": False,
        "compare": False,
        "history": False,
        "run": "run-1",
        "left_out": [],
    }


def test_a_run_whose_runner_was_killed_is_given_its_ends(tmp_path: Path):
    """An incomplete journal gets its ends: the running test and the run are interrupted."""
    folder = put(tmp_path, STARTED, TestStarted(test="s/t", time=2.0), torn=b'{"event":"message","ti')
    lines = [json.loads(line) for line in archived(folder)['id="rtf-journal"'].splitlines()]
    assert [(line["event"], line.get("verdict"), line.get("stage")) for line in lines] == [
        ("run_started", None, None),
        ("test_started", None, None),
        ("interrupted", None, 3),
        ("test_ended", "interrupted", None),
    ]


def test_a_run_that_was_resumed_is_one_run(tmp_path: Path):
    """A resumed run is archived as one run."""
    ended = TestEnded(test="s/t", verdict=Verdict.INTERRUPTED, outcome=Verdict.INTERRUPTED, time=3.0)
    passed = TestEnded(test="s/t", verdict=Verdict.PASSED, outcome=Verdict.PASSED, time=5.0)
    start = TestStarted(test="s/t", time=2.0)
    again = RunStarted(run="run-1", version="1", resumed=True, time=4.0)
    folder = put(tmp_path, STARTED, start, ended, again, start, passed, ENDED)
    assert archived(folder)['id="rtf-journal"'] == b"".join(map(to_line, [STARTED, start, passed, ENDED]))


def test_what_was_seen_of_a_series_gives_way_to_the_series(tmp_path: Path):
    """Samples of a series are omitted where the recorded series is in the archive."""
    np.savez(tmp_path / "x.npz", t=[0.0, 1.0], x=[2.0, 3.0])
    samples = [
        SeriesSampled(test=test, name="x", columns=({"name": "t"},), samples=([0.0],), time=time)  # type: ignore[arg-type]
        for test, time in [("s/t", 2.0), ("s/other", 3.0), ("s/t", 5.0)]
    ]
    folder = put(tmp_path, STARTED, *samples[:2], series("x.npz", 2, time=4.0), samples[2], ENDED)
    lines = [json.loads(line) for line in archived(folder)['id="rtf-journal"'].splitlines()]
    assert [(line["event"], line["time"]) for line in lines[1:-1]] == [
        ("series_sampled", 3.0),
        ("series_recorded", 4.0),
        ("series_sampled", 5.0),
    ]


def test_a_series_is_packed_as_the_server_packs_it(tmp_path: Path):
    """A series is archived in the server's binary form."""
    np.savez(tmp_path / "x.npz", t=[0.0, 1.0], x=[2.0, 3.0])
    data = archived(put(tmp_path, STARTED, series("x.npz", 2), ENDED))['data-series="x.npz"']
    assert np.frombuffer(data[:12], "<u4").tolist() == [2, 2, 0]
    assert np.frombuffer(data[12:], "<f8").tolist() == [0.0, 1.0, 2.0, 3.0]


def test_many_series_share_the_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Many series get fewer points each, before any is omitted."""
    monkeypatch.setattr(archive, "MAX_SERIES", 3 * 2 * 8 * 1000)
    for name in "abcd":
        np.savez(tmp_path / f"{name}.npz", t=np.arange(5000.0), x=np.zeros(5000))
    found = archived(put(tmp_path, STARTED, *[series(f"{name}.npz", 5000) for name in "abcd"], ENDED))
    kept = {name: np.frombuffer(data[:12], "<u4") for name, data in found.items() if "series" in name}
    assert len(kept) >= 3
    assert all(rows <= 1000 and thinned for _, rows, thinned in kept.values())
    assert len(kept) + len(left_out(found)) == 4


def test_an_invalid_series_is_reported(tmp_path: Path):
    """A damaged or missing series is reported, and the others are archived."""
    np.savez(tmp_path / "good.npz", t=[0.0], x=[1.0])
    (tmp_path / "bad.npz").write_bytes(b"PK?")
    found = archived(put(tmp_path, STARTED, series("bad.npz", 2), series("gone.npz", 2), series("good.npz", 1), ENDED))
    assert sorted(left_out(found)) == ["bad.npz", "gone.npz"]
    assert 'data-series="good.npz"' in found


def test_attachments_and_pictures_of_questions_are_put_in(tmp_path: Path):
    """Attachments and pictures are archived once, images first, with a safe type."""
    for name in ("log.txt", "evil.html", "a.png", "b.png"):
        (tmp_path / name).write_text(name)
    asked = Asked(test="s/t", question="q", text="?", picture="b.png")
    names = ["log.txt", "evil.html", "a.png", "a.png"]
    found = archived(put(tmp_path, STARTED, *[attached(name, media_type="text/html") for name in names], asked, ENDED))
    assert [(name, data) for name, data in found.items() if "data-file" in name] == [
        ('data-file="a.png" data-type="image/png"', b"a.png"),
        ('data-file="b.png" data-type="image/png"', b"b.png"),
        ('data-file="log.txt" data-type="text/plain"', b"log.txt"),
        ('data-file="evil.html" data-type="application/octet-stream"', b"evil.html"),
    ]


def test_attachments_are_bounded_one_by_one_and_in_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Attachments have a size limit each and together; omitted ones are reported with their size."""
    monkeypatch.setattr(archive, "MAX_ATTACHMENT", 100)
    monkeypatch.setattr(archive, "MAX_ATTACHMENTS", 150)
    for name, size in [("large", 101), ("a", 90), ("b", 80), ("c", 60)]:
        (tmp_path / name).write_bytes(bytes(size))
    found = archived(put(tmp_path, STARTED, *[attached(name) for name in ("large", "a", "b", "c")], ENDED))
    assert [name.split('"')[1] for name in found if "data-file" in name] == ["a", "c"]
    assert [(row["path"], row["size"]) for row in facts(found)["left_out"]] == [("large", 101), ("b", 80)]
    assert all("larger than" in reason for reason in left_out(found).values())


@pytest.mark.parametrize("path", ["../outside", "/etc/passwd", "link", "", ".hidden", "folder"])
def test_nothing_comes_from_outside_the_folder(tmp_path: Path, path: str):
    """Paths of the journal that lead out of the folder are refused."""
    (tmp_path / "outside").write_text("secret")
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "folder").mkdir()
    (folder / ".hidden").write_text("secret")
    (folder / "link").symlink_to(tmp_path / "outside")
    found = archived(put(folder, STARTED, attached(path), series(path, 1), ENDED))
    assert not [name for name in found if name.startswith("data-")]
    assert [*left_out(found)] == ([path] if path else [""])


def test_an_earlier_run_and_the_trends_are_put_in(tmp_path: Path):
    """An earlier run and trends are archived, and mentioned in the facts."""
    extras = Extras(compare=[{"event": "run_started", "run": "old"}], history={"runs": []})
    found = archived(put(tmp_path, STARTED, ENDED), extras)
    assert (facts(found)["compare"], facts(found)["history"]) == (True, True)
    assert json.loads(found['id="rtf-compare"']) == extras.compare
    assert json.loads(found['id="rtf-history"']) == extras.history


def test_a_folder_without_a_journal_is_an_error(tmp_path: Path):
    """The error about a folder without a journal has its path."""
    with pytest.raises(JournalError, match=re.escape(str(tmp_path))):
        archived(tmp_path)


@given(st.text(), st.lists(st.binary(max_size=200), max_size=6))
def test_no_data_and_no_name_ends_its_element(name: str, pieces: list[bytes]):
    """Any data and names are archived without foreign markup, and read back."""
    stream = io.BytesIO()
    write_block(stream, {"data-file": name}, pieces)
    (found,) = BLOCK.findall(stream.getvalue())
    assert stream.getvalue().count(b"<") == 2
    assert gzip.decompress(base64.b64decode(found[1])) == b"".join(pieces)


def test_memory_stays_flat(tmp_path: Path):
    """The memory for archiving does not grow with the journal."""
    script = textwrap.dedent(
        """
        import resource, sys
        from pathlib import Path
        from rtf.page.archive import write_archive
        with open(sys.argv[2], "wb") as stream:
            write_archive(stream, Path(sys.argv[1]))
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        """
    )

    def memory(folder: Path, count: int, *, whole: bool) -> int:
        folder.mkdir()
        with (folder / FILE_NAME).open("wb") as stream:
            stream.write(to_line(STARTED))
            for number in range(count):
                detail = f"{number * 7919 % 10007}" * 20
                stream.write(
                    to_line(Message(severity=Severity.INFO, title="says", detail=detail, time=2.0, seq=number))
                )
            if whole:
                stream.write(to_line(ENDED))
        ran = subprocess.run(
            [sys.executable, "-c", script, str(folder), str(folder / "out.html")],
            check=True,
            capture_output=True,
            text=True,
        )
        return int(ran.stdout)

    for whole, counts in ((True, (1_000, 60_000)), (False, (1_000, 15_000))):
        small, large = (memory(tmp_path / f"{whole}{count}", count, whole=whole) for count in counts)
        assert large < small + 3_000  # KiB; the journals differ by 13 and 3 MB
