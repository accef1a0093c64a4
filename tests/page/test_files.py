"""Which paths lead to a file of the run, and as what it may be shown."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.page.errors import FileRefusedError
from rtf.page.files import inside, is_shown, media_type


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run's folder with a file, and a secret beside it."""
    (tmp_path / "secret").write_text("secret")
    run = tmp_path / "run"
    (run / "files").mkdir(parents=True)
    (run / "files" / "a b.txt").write_text("fine")
    (run / ".hidden").write_text("hidden")
    (run / "link").symlink_to(tmp_path / "secret")
    (run / "up").symlink_to(tmp_path)
    (run / "loop").symlink_to(run / "loop")
    (run / "inner").symlink_to(run / "files" / "a b.txt")
    os.mkfifo(run / "fifo")
    return run


def test_files_of_the_run_are_found(folder: Path):
    """Also through a link, as long as it stays inside."""
    assert inside(folder, "files/a b.txt").read_text() == "fine"
    assert inside(folder, "inner").read_text() == "fine"


@pytest.mark.parametrize(
    "name",
    [
        *("", ".", "..", "../secret", "files/../../secret", "files", "/etc/passwd", "//etc/passwd", "files//a b.txt"),
        *("link", "up/secret", "loop", "fifo", ".hidden", "files/\0", "missing", "x" * 5000, "a/" * 5000, "\udcff"),
    ],
)
def test_nothing_else_is(folder: Path, name: str):
    """Not what is outside, not through links, not what is hidden or no file."""
    with pytest.raises(FileRefusedError):
        inside(folder, name)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(["..", ".", "/", "\\", "files", "up", "link", "secret", "%2e", "\0", "é"]), max_size=8))
def test_no_path_leads_outside(folder: Path, parts: list[str]):
    """Whatever is put together, what is found lies inside."""
    try:
        found = inside(folder, "".join(parts))
    except FileRefusedError:
        return
    assert found.is_relative_to(folder)
    assert found.read_text() == "fine"


@pytest.mark.parametrize(
    ("name", "kind", "shown"),
    [
        ("a.png", "image/png", True),
        ("a.LOG", "text/plain", True),
        ("a.json", "application/json", True),
        ("a.pdf", "application/pdf", False),
        ("a.html", "application/octet-stream", False),
        ("a.svg", "application/octet-stream", False),
        ("a.js", "application/octet-stream", False),
        ("a.xhtml", "application/octet-stream", False),
        ("a.txt.gz", "application/octet-stream", False),
        ("a.png.html", "application/octet-stream", False),
        ("a", "application/octet-stream", False),
    ],
)
def test_only_what_carries_no_script_is_shown(name: str, kind: str, shown: bool):
    """Everything else is bytes to download."""
    assert media_type(Path(name)) == kind
    assert is_shown(kind) == shown
