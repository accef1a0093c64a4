"""Running tasks: results, workers that die, real robots, hostile results, and a file that is complete at any time."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

import pytest

from rtf.campaigns.backends.local import LocalBackend
from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.conductor import Conductor
from rtf.campaigns.designs import make_design
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.outcomes import Measured
from rtf.campaigns.store import CampaignStore, ResultError, State, outcomes_of
from rtf.campaigns.task_run import PERMITTED, Job, Status, decode_result, encode_job, run_task
from rtf.campaigns.tasks import RealRobot, Task
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

TEST = '[[tests]]\nname = "trivial.py"\n'


@pytest.fixture
def backend() -> Iterator[LocalBackend]:
    """Two workers."""
    made = LocalBackend(2, 1)
    yield made
    made.close()


def run(path: Path, backend: LocalBackend) -> dict[State, int]:
    """Run a campaign, or go on with it; return the number of tasks in each state."""
    campaign = load_campaign(path)
    with CampaignStore(path.with_suffix(".sqlite"), create=True, exclusive=True) as store:
        store.begin()
        Conductor(campaign, make_design(campaign), store, backend).run()
        return dict(store.counts())


def test_every_run_has_an_outcome_and_none_is_made_twice(write: Callable[[str], Path], backend: LocalBackend):
    """A campaign of passing and failing runs; more seeds add runs, and leave the others alone."""
    text = 'seeds = 1\n[[tests]]\nname = "trivial.py"\n[[overrides]]\nparameter = "does"\nvalues = ["pass", "fail"]\n'
    path = write(text)
    assert run(path, backend) == {State.DONE: 2}
    state = path.with_suffix(".sqlite")
    before = [*outcomes_of(state)]
    assert [(one.test, one.verdict, one.named) for one in before] == [
        ("trivial", Verdict.PASSED, None),
        ("trivial", Verdict.FAILED, "l_elbow"),
    ]
    assert before[0].measurements == {"height": Measured(1.5, "m", None, 2.0)}
    assert before[0].processor_seconds > 0.0
    assert before[0].healthy
    write(text.replace("seeds = 1", "seeds = 2"))
    assert run(path, backend) == {State.DONE: 4}
    after = [*outcomes_of(state)]
    assert after[:2] == before
    assert [one.seed for one in after] == [0, 0, 1, 1]


def test_a_run_that_kills_its_worker_is_a_finding(write: Callable[[str], Path], backend: LocalBackend):
    """A task is tried as often as the file says; then it is an outcome, and the campaign ends."""
    path = write('attempts = 2\n[[tests]]\nname = "trivial.py"\nparameters = { does = "kill" }\n')
    assert run(path, backend) == {State.KILLED: 1}
    with CampaignStore(path.with_suffix(".sqlite")) as store:
        ((_, state, detail),) = store.endings()
        (outcome,) = store.outcomes()
    assert (state, outcome.verdict, outcome.attempts) == (State.KILLED, Verdict.ERROR, 2)
    assert detail.startswith("the runner was killed by SIGKILL")


def test_what_cannot_begin_is_reported_with_the_words_of_the_runner():
    """A run whose suite is missing on the worker is broken, and not a worker that died."""
    task = Task(suite="no.xml")
    result = decode_result(run_task(encode_job(Job(task.key, task, {}, 20.0))))
    assert result.status is Status.BROKEN
    assert "no.xml" in result.detail


def job(task: Task, folder: Path) -> bytes:
    """Return a job with the trivial test."""
    files = {"trivial.py": (folder / "trivial.py").read_bytes()}
    return encode_job(Job(task.key, task, files, 20.0))


def test_a_real_robot_moves_by_permission_and_once(
    write: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Without the permission of the worker's machine nothing begins; what began once does not begin again by itself."""
    write("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    task = Task(test="trivial.py", real=RealRobot("icub01", "127.0.0.1", 1, "/root", "icub"))
    monkeypatch.delenv(PERMITTED, raising=False)
    assert decode_result(run_task(job(task, tmp_path))).status is Status.REFUSED
    monkeypatch.setenv(PERMITTED, "icub00,icub01")
    assert decode_result(run_task(job(task, tmp_path))).status is Status.DONE  # its fixture is lost: there is no robot
    again = decode_result(run_task(job(task, tmp_path)))
    assert again.status is Status.BEGUN
    assert "icub01" in again.detail


@pytest.fixture
def packed(write: Callable[[str], Path], tmp_path: Path) -> bytes:
    """The journal of a run, as a worker sends it."""
    write("")
    return decode_result(run_task(job(Task(test="trivial.py"), tmp_path))).journal


def test_results_are_parsed_as_untrusted(packed: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Damaged, foreign, unfinished and huge results are refused, and nothing of them is written."""
    lines = zlib.decompress(packed)
    other = lines.replace(Task(test="trivial.py").key.encode(), b"0" * 20)
    hostile = {
        "damaged": (b"", b"x" * 100, packed[:-10], packed + b"more"),
        "cannot be read": (zlib.compress(b'{"event":"run_started"}\n' + lines), zlib.compress(b"\xff\n\xff\n")),
        "not that of a whole run": tuple(map(zlib.compress, (lines[: len(lines) // 2], other, b""))),
    }
    monkeypatch.setattr("rtf.campaigns.store.MOST_JOURNAL", 1 << 20)
    hostile["more than 1 MiB"] = (zlib.compress(b"\n" * (10 << 20)),)
    with CampaignStore(tmp_path / "c.sqlite", create=True) as store:
        store.add([Task(test="trivial.py")])
        (row,) = store.take(1)
        for message, journals in hostile.items():
            for data in journals:
                with pytest.raises(ResultError, match=message):
                    store.finish(row, data, 1.0)
        assert store.runs() == []
        assert store.finish(row, packed, 1.0) is False
        assert store.journal_of(row.task.key) == lines
        assert store.found() == {row.task.key: False}


def test_one_process_runs_a_campaign(tmp_path: Path):
    """A second one is refused while the first one lives; a reader is not."""
    path = tmp_path / "c.sqlite"
    with CampaignStore(path, create=True, exclusive=True) as store:
        store.add([Task(test="a"), Task(test="a"), Task(test="b")])
        with pytest.raises(CampaignError, match="another process runs this campaign"):
            CampaignStore(path, create=True, exclusive=True)
        with CampaignStore(path) as reader:
            assert reader.counts() == {State.WAITING: 2}
    CampaignStore(path, exclusive=True).close()


def test_what_ran_when_the_client_died_runs_again_unless_it_moved_a_robot(tmp_path: Path):
    """A simulated run waits again; one on a real robot is lost until a person asks for it, and then is another one."""
    real = Task(test="b", real=RealRobot("icub01", "h", 1, "/root", "icub"))
    with CampaignStore(tmp_path / "c.sqlite", create=True) as store:
        store.add([Task(test="a"), real])
        assert [row.task for row in (*store.take(5), *store.take(5, "icub01"))] == [Task(test="a"), real]
        store.begin()
        assert store.counts() == {State.WAITING: 1, State.LOST: 1}
        store.begin(again=True)
        ((row,), (again,)) = store.take(5), store.take(5, "icub01")
    assert (row.attempts, again.attempts) == (0, 1)


def test_stopping_puts_back_what_is_dropped(write: Callable[[str], Path], backend: LocalBackend):
    """A campaign that is stopped with drop leaves its simulated runs to the next time."""
    path = write(f"seeds = 3\n{TEST}")
    campaign = load_campaign(path)
    with CampaignStore(path.with_suffix(".sqlite"), create=True) as store:
        conductor = Conductor(campaign, make_design(campaign), store, backend)
        conductor.run(lambda _: conductor.stop(drop=True))
        assert set(store.counts()) <= {State.WAITING, State.DONE}
    assert run(path, backend) == {State.DONE: 3}
