"""The plan: classes of a file, matrices, and the description of a plug-in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from msgspec import structs

from harness import run_command, write_files
from rtf.testing import Matrix, plugins
from rtf.testing.inspection import inspect_plugins
from rtf.testing.plan import Planner, load_files
from rtf.testing.plugin_source import specs_in
from rtf.testing.plugin_spec import PluginSpec, combinations
from rtf.testing.verdict import ExitCode, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.testing.suite.model import TestEntry

NOD = """
from rtf.testing import Matrix, Parameter, TestCase
class Nod(TestCase):
    speed = Parameter(float, "speed", unit="deg/s", default=1.0, aliases=("pace",))
    part = Parameter(str, "part", default="")
    gains = Parameter(list[float], "gains", default=[])
    matrix = Matrix(speed=(10, 20.5), part=("head", "left arm"))
    def run(self): self.report(f"{self.part} {self.speed:g} {self.gains}")
"""
TWO = """
from rtf.testing import TestCase
class Base(TestCase):
    def run(self): self.check(True, "runs")
class Left(Base):
    '''The left one.'''
    tags = ("left",)
class Right(Base):
    tags = ("right",)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a matrix and a file with two classes."""
    write_files(tmp_path, {"nod.py": NOD, "two.py": TWO})
    return tmp_path


def planned(folder: Path, body: str, **overrides: str) -> list[TestEntry]:
    """Return the planned tests of a suite with this content, of which none may be missing."""
    (folder / "s.xml").write_text(f'<suite name="s">{body}</suite>')
    loaded = load_files([(folder / "s.xml", True)], {})
    assert not loaded.diagnostics
    planner = Planner([*overrides.items()])
    (suite,) = planner.plan(loaded.suites)
    assert [test.problem for test in suite.tests if test.found is None] == []
    return [*suite.tests]


def test_a_matrix_makes_a_test_of_each_combination(folder: Path):
    """Each combination is a test with pytest's label; the last parameter changes first."""
    entries = planned(folder, "<test>nod.py</test>")
    assert [test.name for test in entries] == [
        "nod[10-head]",
        "nod[10-left arm]",
        "nod[20.5-head]",
        "nod[20.5-left arm]",
    ]
    assert [test.id for test in entries][:2] == ["s/nod[10-head]", "s/nod[10-left-arm]"]
    assert entries[-1].parameters == (("speed", "20.5"), ("part", "left arm"))


@pytest.mark.parametrize(
    ("body", "overrides"),
    [
        ('<test>nod.py<parameter name="speed">5</parameter></test>', {}),
        ('<test param="--speed 5">nod.py</test>', {}),
        ('<test>nod.py<parameter name="pace">5</parameter></test>', {}),
        ("<test>nod.py</test>", {"speed": "5"}),
        ("<test>nod.py</test>", {"pace": "5"}),
    ],
)
def test_what_a_suite_or_the_command_line_sets_is_not_varied(folder: Path, body: str, overrides: dict[str, str]):
    """A parameter that suite or command line sets is not varied."""
    assert [test.name for test in planned(folder, body, **overrides)] == ["nod[head]", "nod[left arm]"]


def test_a_matrix_of_computed_values_is_known_before_the_run(folder: Path):
    """A computed or inherited matrix is found by loading the plug-in in a child."""
    computed = NOD.replace("speed=(10, 20.5), part=", "gains=([v / 2] for v in range(2)), part=")
    write_files(folder, {"nod.py": computed, "nods.py": "from nod import Nod\nclass Again(Nod):\n    pass\n"})
    names = [test.name for test in planned(folder, "<test>nods.py</test>")]
    assert names == ["nods[gains0-head]", "nods[gains0-left arm]", "nods[gains1-head]", "nods[gains1-left arm]"]
    outcome = run_command(folder, "--suite", "s.xml", "-k", "gains1-head", "-v")
    assert outcome.exit_code == ExitCode.PASSED
    assert "head 1 [0.5]" in outcome.stdout


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"speed": ()}, "different values of 'speed'"),
        ({"speed": (1, 1)}, "different values of 'speed'"),
        ({"speed": (object(),)}, "a matrix holds"),
    ],
)
def test_a_matrix_that_makes_no_sense_is_the_authors_error(values: dict[str, tuple[object, ...]], problem: str):
    """An invalid matrix raises an error when it is declared."""
    with pytest.raises((ValueError, TypeError), match=problem):
        Matrix(**values)


def test_a_matrix_takes_what_parameters_take():
    """A matrix may have booleans, numbers, texts and lists."""
    axes = Matrix(a=(True,), b=("",), c=([1, 2.5], ["x y"])).axes
    assert [*combinations(PluginSpec(matrix=axes), ())] == [
        ("True--c0", (("a", "true"), ("b", '""'), ("c", "(1 2.5)"))),
        ("True--c1", (("a", "true"), ("b", '""'), ("c", '("x y")'))),
    ]


def test_all_test_classes_of_a_file_run(folder: Path):
    """All test classes of a file are planned with their tags, but not their common base."""
    entries = planned(folder, "<test>two.py</test>")
    assert [(test.name, test.id, test.tags) for test in entries] == [
        ("two::Left", "s/two.Left", ("left",)),
        ("two::Right", "s/two.Right", ("right",)),
    ]


@pytest.mark.parametrize("test", ['<test class="Right">two.py</test>', "<test>two.py::Right</test>"])
def test_one_class_of_a_file_is_named_by_class_or_after_two_colons(folder: Path, test: str):
    """A class is named by an attribute or after ``::``, with the same id."""
    assert [(entry.name, entry.id) for entry in planned(folder, test)] == [("two::Right", "s/two.Right")]


@pytest.mark.parametrize(
    ("arguments", "ran"),
    [
        (["--test", "two.py"], ["two::Left", "two::Right"]),
        (["--test", "two.py::Left"], ["two::Left"]),
        (["--tests", ".", "-k", "right"], ["two::Right"]),
        (["--test", "nod.py", "-k", "nod[10-head]"], ["nod[10-head]"]),
    ],
)
def test_classes_and_combinations_are_chosen_on_the_command_line(folder: Path, arguments: list[str], ran: list[str]):
    """Classes are selected by ``file.py::Class``, combinations by ``-k``."""
    outcome = run_command(folder, *arguments)
    assert outcome.exit_code == ExitCode.PASSED, outcome.stderr
    assert [test.name for test in outcome.results.tests.values()] == ran


@pytest.mark.parametrize("command", [["--dry-run", "--test"], ["describe"]])
def test_the_error_of_an_unknown_class_has_the_known_ones(folder: Path, command: list[str]):
    """The error about an unknown class lists those of the file."""
    done = run_command(folder, *command, "two.py::Lft")
    assert done.exit_code == ExitCode.USAGE
    assert "has no class 'Lft'; it has Base, Left, Right" in done.stderr


def test_a_test_that_requires_one_with_a_matrix_requires_all_of_it(folder: Path):
    """Requiring a test with a matrix requires every combination."""
    *_, last = planned(folder, '<test>nod.py</test><test class="Left" requires="test:nod">two.py</test>')
    assert len(last.required_tests) == 4


@pytest.mark.parametrize("kind", ["test", "fixture"])
def test_the_text_of_every_shipped_plug_in_describes_the_loaded_class(kind: str):
    """The description read from the text agrees with the loaded class, for every shipped plug-in."""
    folder = plugins.shipped_folder(kind)
    refs = {
        plugins.PluginRef(kind, path.name, str(path), "python", spec.class_name): spec
        for path in sorted(folder.glob("*.py"))
        for spec in specs_in(path)
    }
    found = inspect_plugins(dict.fromkeys(refs, ()))
    assert [one.problems for one in found.values() if one.problems] == []
    for ref, read in refs.items():
        loaded = structs.replace(found[ref].spec, description=read.description, parameters=read.parameters)
        assert found[ref].spec.summary == read.summary
        assert structs.replace(loaded, names=read.names) == read, ref
        assert {one.names for one in found[ref].spec.parameters if one.name not in ("name", "description")} == {
            one.names for one in read.parameters if one.name not in ("name", "description")
        }


def test_facts_that_the_text_computes_are_known_before_the_run(folder: Path):
    """Computed tags and requirements are known before the run."""
    text = 'from rtf.testing import TestCase\nTAGS = ("slow",)\nclass Slow(TestCase):\n    tags = TAGS\n'
    write_files(folder, {"slow.py": f'{text}    requires = ("env:" + "NOT_THERE",)\n    def run(self): pass\n'})
    outcome = run_command(folder, "slow.py", "two.py", "--tags", "slow")
    assert [(test.name, test.verdict) for test in outcome.results.tests.values()] == [("slow", Verdict.SKIPPED)]
