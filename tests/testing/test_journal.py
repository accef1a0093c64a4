"""The journal: complete after each event, readable after any cut, with one writer."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
import threading
from contextlib import closing
from typing import TYPE_CHECKING

import psutil
import pytest

from rtf.testing import journal
from rtf.testing.events import EventError, Message, TestEnded, from_line, to_line
from rtf.testing.journal import Journal, JournalError
from rtf.testing.verdict import Severity, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.events import Event


def message(number: int, detail: str = "") -> Message:
    """Return a unique event."""
    return Message(severity=Severity.INFO, title=f"n{number}", detail=detail, seq=number, time=float(number))


@pytest.fixture
def path(tmp_path: Path):
    """The path of the journal."""
    return tmp_path / journal.FILE_NAME


def written(path: Path, *events: Event) -> Path:
    """Write a journal of these events."""
    with closing(Journal(path)) as book:
        for event in events:
            book.append(event)
    return path


def test_what_is_appended_is_read_back(path: Path):
    """Appended events are read in order, from the file or from the run's folder."""
    events = [message(number) for number in range(1, 50)]
    written(path, *events)
    assert [*journal.read(path)] == events
    assert [*journal.read(path.parent)] == events


def test_torn_last_line_is_tolerated_at_every_byte(path: Path):
    """A journal cut at any byte gives all its whole lines."""
    events = [message(1), message(2, "long " * 20), message(3, "\ud800\x00")]
    data = written(path, *events).read_bytes()
    ends = [index + 1 for index, byte in enumerate(data) if byte == 10]
    for cut in range(len(data) + 1):
        path.write_bytes(data[:cut])
        assert [*journal.read(path)] == events[: sum(end <= cut for end in ends)]


def test_torn_end_is_cut_off_when_the_run_is_resumed_at_every_byte(path: Path):
    """Resuming removes an incomplete last line before it appends."""
    data = written(path, message(1), message(2)).read_bytes()
    first = data.index(b"\n") + 1
    for cut in range(first, len(data) + 1):
        path.write_bytes(data[:cut])
        with closing(Journal(path, resume=True)) as book:
            book.append(message(3))
        whole = 1 + (cut == len(data))
        assert [event.seq for event in journal.read(path)] == [*range(1, whole + 1), 3]


def test_line_in_the_middle_that_is_no_event_is_an_error_with_its_place(path: Path):
    """A damaged line before the end is an error with file and line."""
    written(path, message(1), message(2), message(3))
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b"garbage\n" + lines[2])
    with pytest.raises(EventError, match=r"journal.jsonl:2: not JSON"):
        [*journal.read(path)]


def test_event_of_a_newer_version_is_passed_over(path: Path):
    """An event of an unknown kind is skipped."""
    path.write_bytes(to_line(message(1)) + b'{"event":"teleported","seq":2}\n' + to_line(message(3)))
    assert [event.seq for event in journal.read(path)] == [1, 3]


def test_journal_that_is_there_is_not_overwritten(path: Path):
    """An existing journal is not overwritten by another run."""
    written(path, message(1))
    with pytest.raises(JournalError, match="File exists"):
        Journal(path)
    assert [*journal.read(path)] == [message(1)]


def test_journal_has_one_writer(path: Path):
    """A second writer is refused until the first one has closed."""
    with closing(Journal(path)) as book:
        book.append(message(1))
        with pytest.raises(JournalError, match="another runner is writing it"):
            Journal(path, resume=True)
    with closing(Journal(path, resume=True)) as book:
        book.append(message(2))
    assert [event.seq for event in journal.read(path)] == [1, 2]


def test_folder_that_cannot_be_written_is_an_error_that_names_it(tmp_path: Path):
    """The error about a folder that cannot be written names it."""
    with pytest.raises(JournalError, match=r"cannot write the journal .*none/journal\.jsonl"):
        Journal(tmp_path / "none" / journal.FILE_NAME)


def test_a_run_that_is_not_there_is_named(tmp_path: Path):
    """The error about a missing run names the folder or the journal."""
    none, empty = tmp_path / "none", tmp_path / "empty"
    empty.mkdir()
    for run, missing in ((none, none), (empty, empty / journal.FILE_NAME)):
        with pytest.raises(JournalError) as caught:
            [*journal.read(run)]
        assert str(caught.value) == f"there is no run in {run}: {missing} is missing"


def test_lines_of_several_threads_are_whole(path: Path):
    """Lines of several threads are not mixed."""
    with closing(Journal(path)) as book:

        def write(base: int) -> None:
            for number in range(500):
                book.append(message(base + number, "x" * (number % 97)))

        threads = [threading.Thread(target=write, args=(base,)) for base in (1000, 2000, 3000)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert sorted(event.seq for event in journal.read(path)) == [
        base + number for base in (1000, 2000, 3000) for number in range(500)
    ]


def test_every_event_is_with_the_kernel_when_append_returns(path: Path):
    """Events of a writer that is killed right after ``append`` are in the file."""
    code = f"""
        import os, signal
        from pathlib import Path
        from rtf.testing.events import Message
        from rtf.testing.journal import Journal
        book = Journal(Path({str(path)!r}))
        for number in range(1, 101):
            book.append(Message(severity="info", title="x", seq=number))
        os.kill(os.getpid(), signal.SIGKILL)
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert [event.seq for event in journal.read(path)] == [*range(1, 101)]


def test_memory_stays_flat(path: Path):
    """Writing and reading a hundred thousand events keeps none in memory."""
    event = message(1, "x" * 200)
    with closing(Journal(path)) as book:
        for _ in range(1000):
            book.append(event)
        before = psutil.Process().memory_info().rss
        for _ in range(100_000):
            book.append(event)
    assert sum(1 for _ in journal.read(path)) == 101_000
    assert psutil.Process().memory_info().rss - before < 4 << 20


def test_full_disk_is_an_error_and_what_was_whole_is_kept(path: Path):
    """A full disk is an error, and the lines before it are whole."""
    code = f"""
        import resource, signal
        from pathlib import Path
        from rtf.testing.events import Message
        from rtf.testing.journal import Journal, JournalError
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))
        book = Journal(Path({str(path)!r}))
        count = 0
        try:
            while True:
                book.append(Message(severity="info", title="x", seq=count + 1))
                count += 1
        except JournalError as error:
            print(count, error)
        book.close()
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True, capture_output=True, text=True)
    count, _, text = ended.stdout.partition(" ")
    assert "cannot write the journal" in text
    assert "File too large" in text
    assert path.stat().st_size == 5000
    assert [event.seq for event in journal.read(path)] == [*range(1, int(count) + 1)]


def test_closing_twice_is_harmless(path: Path):
    """Closing twice has no effect."""
    book = Journal(path)
    book.append(TestEnded(test="t", verdict=Verdict.PASSED, outcome=Verdict.PASSED))
    book.close()
    book.close_quietly()
    assert from_line(path.read_bytes()).kind == "test_ended"
