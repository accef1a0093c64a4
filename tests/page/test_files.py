"""Files of the run: which paths are served, and as which type."""

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
    """A run's folder with a file and links, and a secret beside it."""
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
    """Files are found, also through a link within the folder."""
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
    """Paths to other files, links out of the folder, hidden files and folders are refused."""
    with pytest.raises(FileRefusedError):
        inside(folder, name)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(["..", ".", "/", "\\", "files", "up", "link", "secret", "%2e", "\0", "é"]), max_size=8))
def test_no_path_leads_outside(folder: Path, parts: list[str]):
    """Any combination of parts finds a file within the folder, or is refused."""
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
    """Only types without scripts are shown; all others are downloaded."""
    assert media_type(Path(name)) == kind
    assert is_shown(kind) == shown
