"""Every page of the documentation is run: its files are written, its commands executed, their output compared."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from free_ports import free_port

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(?P<info>[^\n]*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, dict[str, str], str]]:
    """The fenced blocks of a page: language, attributes of the info string, text."""
    found = []
    for match in BLOCK.finditer(page.read_text(encoding="utf-8")):
        language, *words = match["info"].split() or [""]
        attributes = dict(word.partition("=")[::2] for word in words)
        found.append((language, attributes, match["body"]))
    return found


def runnable(page: Path) -> bool:
    """Whether a page has something to run."""
    return any(language == "console" or "file" in attributes for language, attributes, _ in blocks(page))


def matches(expected: str, printed: str) -> bool:
    """Whether the expected lines occur in this order, white space aside.

    ``…`` stands for anything inside a line, and alone for any lines.
    """
    position = 0
    lines = [" ".join(line.split()) for line in printed.splitlines()]
    for wanted in (" ".join(line.split()) for line in expected.splitlines()):
        if wanted in ("", "…"):
            continue
        pattern = re.compile(".*".join(re.escape(part) for part in wanted.split("…")))
        while position < len(lines) and not pattern.fullmatch(lines[position]):
            position += 1
        if position == len(lines):
            return False
        position += 1
    return True


def commands(body: str) -> list[tuple[str, str]]:
    """The commands of a console block, each with the output that is shown for it."""
    found: list[tuple[str, str]] = []
    for line in body.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], ""))
        elif found:
            command, output = found[-1]
            found[-1] = (command, f"{output}{line}\n")
    return found


def run(command: str, folder: Path, environment: dict[str, str]) -> tuple[int, str]:
    """Run a command; return its exit status and what it printed. What does not end is killed with all that it runs."""
    with subprocess.Popen(
        shlex.split(command, comments=True),
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            printed = "".join(process.communicate(timeout=100))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise AssertionError(f"{command}\ndid not end\n{''.join(process.communicate())}") from None
    return process.returncode, printed


@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)], ids=lambda page: page.stem)
def test_a_page_does_what_it_says(page: Path, tmp_path: Path):
    """Files and commands of a page, in order, in one folder, give what the page shows."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "NO_COLOR": "1"}
    environment |= {"COLUMNS": "160", "PORT": str(free_port())}
    for language, attributes, body in blocks(page):
        if "file" in attributes:
            path = tmp_path / attributes["file"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(body, encoding="utf-8")
            if body.startswith("#!"):
                path.chmod(0o755)
        elif language == "console":
            for command, shown in commands(body):
                if command.startswith(("make ", "git ", "pip ")):
                    continue  # what installs the project is run by CI itself
                status, printed = run(command, tmp_path, environment)
                assert status == int(attributes.get("exit", "0")), f"{command}\n{printed}"
                assert matches(shown, printed), f"{command}\nshown:\n{shown}\nprinted:\n{printed}"


def test_no_page_is_a_dead_end():
    """Every relative link of every page leads somewhere."""
    dead = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in PAGES
        for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert not dead, dead


def test_a_decision_has_its_own_number():
    """No two decision records have the same number, and the title has that of the file."""
    pages = sorted((ROOT / "docs" / "decisions").glob("*.md"))
    numbers = [int(page.name[:4]) for page in pages]
    assert len({*numbers}) == len(numbers), [page.name for page in pages]
    titles = [page.read_text(encoding="utf-8").split()[1].rstrip(":") for page in pages]
    assert [*map(str, numbers)] == titles
