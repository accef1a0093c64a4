"""Commands that are shown but not run by the tests of the pages: pipelines for CI, and commands that need a robot."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from harness import Outcome, run_command
from rtf.cli.arguments import parse_run
from rtf.cli.command_tree import RTF, TESTRUNNER

ROOT = Path(__file__).parents[1]
JENKINS, GITLAB = ROOT / "Jenkinsfile", ROOT / ".gitlab-ci.yml.example"
PIPELINES = [JENKINS, GITLAB]
BATTERY = "suites/icubSim/battery.xml"
SHOWN = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: What runs tests or asks about them; the names of the others are in the help of the tools.
COMMANDS = {command.name for command in TESTRUNNER.commands}
TOOLS = {command.name for command in RTF.commands}


def commands(path: Path) -> list[list[str]]:
    """The words of each command of ours in a file, continued lines joined, the suite filled in."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        text = "".join(SHOWN.findall(text))
    text = text.replace("\\\n", " ").replace("$SUITE", BATTERY)
    found = re.findall(r"(?:^|[ '/])((?:testrunner|rtf) [^\n']*)", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in found]


SHOWN_BY = [
    *PIPELINES,
    *(
        path
        for path in sorted([ROOT / "README.md", *ROOT.glob("*/*.md")])
        if SHOWN.search(path.read_text(encoding="utf-8"))
    ),
]


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Outcome]:
    """Run ``testrunner --list`` with these arguments, once for all pages that show them."""
    folder = tmp_path_factory.mktemp("listed")
    return cache(lambda *arguments: run_command(folder, *arguments, "--list"))


@pytest.mark.parametrize("path", SHOWN_BY, ids=lambda path: path.name)
def test_commands_can_be_given(path: Path, listed: Callable[..., Outcome]):
    """Options, tools and suite files of every command exist, and what is selected are some tests."""
    given = commands(path)
    assert given, "a file that shows commands has some of ours"
    for program, *words in given:
        if program == "rtf" or words[0] in COMMANDS:
            assert words[0] in (TOOLS if program == "rtf" else COMMANDS), words
            assert all((ROOT / suite).is_file() for suite in words[1:] if words[0] == "validate"), words
        else:
            options = parse_run(words)
            selection = ["-k", options.names] if options.names else []
            suites = [word for suite in (*options.suite, *options.targets) for word in ("--suite", str(ROOT / suite))]
            tests = ["--test", options.test] if options.test else []
            outcome = listed(*suites, *tests, *selection)
            assert outcome.exit_code == 0, (words, outcome.stderr)
            assert not re.search(r"^0 tests", outcome.stdout, re.MULTILINE), words


@pytest.mark.parametrize("path", PIPELINES, ids=lambda path: path.name)
def test_a_pipeline_publishes_what_its_command_writes(path: Path, tmp_path: Path):
    """Run as it stands on a small suite, the command leaves JUnit and page where the pipeline looks for them."""
    (runs,) = [words[1:] for words in commands(path) if words[1] == "--suite"]
    (tmp_path / "fine.py").write_text(
        "from rtf.testing import TestCase\nclass Fine(TestCase):\n    def run(self): pass\n", encoding="utf-8"
    )
    (tmp_path / "fine.xml").write_text('<suite name="fine"><test>fine.py</test></suite>', encoding="utf-8")
    outcome = run_command(tmp_path, *["fine.xml" if word == BATTERY else word for word in runs])
    assert outcome.exit_code == 0, outcome.stderr
    text = path.read_text(encoding="utf-8")
    (junit,) = re.findall(r"^ *junit(?: testResults)?: ?'?([\w./]+)", text, re.MULTILINE)
    assert "<testcase" in (tmp_path / junit).read_text(encoding="utf-8")
    assert (tmp_path / "results" / "report.html").stat().st_size > 0
    assert "results/" in text.partition("artifact" if path is JENKINS else "artifacts:")[2]


def test_the_jenkinsfile_is_a_declarative_pipeline():
    """Its braces are closed in order, its sections are those that Jenkins knows, and results are kept in any case."""
    code = re.sub(
        r"//[^\n]*|'''.*?'''|'[^'\n]*'|\"[^\"\n]*\"", "", JENKINS.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    depth, sections = 0, []
    for line in code.splitlines():
        if depth == 1 and line.rstrip().endswith("{"):
            sections.append(line.split()[0])
        for bracket in re.findall(r"[{}]", line):
            depth += 1 if bracket == "{" else -1
            assert depth >= 0, line
    assert depth == 0
    assert code.strip().startswith("pipeline {")
    assert sections == ["options", "parameters", "stages", "post"]
    stages = re.findall(r"stage\('(\w+)'\)", JENKINS.read_text(encoding="utf-8"))
    assert stages == ["Install", "Validate", "Battery"]
    assert re.search(r"post\s*\{\s*always\s*\{\s*junit", code)


def test_the_gitlab_file_is_well_formed():
    """Indentation is by two blanks, every line is a key, an item or a comment, and what has to be there is."""
    lines = [line for line in GITLAB.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    for line in lines:
        assert re.fullmatch(r"(  )*(- \S.*|[\w-]+:( \S.*)?)", line), line
    keys = [line.strip().partition(":")[0] for line in lines if not line.strip().startswith("-")]
    assert keys[:3] == ["variables", "SUITE", "robot-tests"]
    assert {"image", "script", "artifacts", "when", "paths", "reports", "junit"} <= set(keys)
    assert "    when: always" in lines


@pytest.mark.parametrize("path", PIPELINES, ids=lambda path: path.name)
def test_the_page_shows_the_files_themselves(path: Path):
    """What is copied from the page is what is tested here."""
    assert f"\n{path.read_text(encoding='utf-8')}```" in (ROOT / "docs" / "jenkins.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", PIPELINES, ids=lambda path: path.name)
def test_no_pipeline_moves_a_real_robot(path: Path):
    """Somebody has to stand beside it."""
    assert "--allow-motion" not in path.read_text(encoding="utf-8")
