"""Collecting suites: which files are collected, the names of their tests, and no effect without suites."""

from __future__ import annotations

import sys
from importlib.metadata import entry_points

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.pytest_suites.nodes import marker_name
from rtf.pytest_suites.sniff import is_suite

pytest_plugins = ("pytester",)

FINE = '<test name="a fine one"> Fine </test>'


@pytest.mark.parametrize(
    "text",
    [
        "<suite/>",
        '<?xml version="1.0" encoding="UTF-8"?>\n<!-- a licence -->\n<suite name="s">',
        "\ufeff<SUITE name='s'>",
        "<!DOCTYPE suite>\n<suite>",
        f"<!--{'x' * 60_000}--><suite>",
    ],
)
def test_suite_is_known_by_its_root_element(tmp_path, text):
    """A file is a suite by its root element, in any case, whatever precedes it."""
    file = tmp_path / "s.xml"
    file.write_text(text, encoding="utf-8")
    assert is_suite(file)


def test_suite_in_sixteen_bits_is_known(tmp_path):
    """A suite in UTF-16 is recognized."""
    file = tmp_path / "s.xml"
    file.write_text("<suite/>", encoding="utf-16")
    assert is_suite(file)


@pytest.mark.parametrize(
    "text",
    ["", "<suites/>", "<testsuite/>", "<suite:x/>", "<robot><suite/></robot>", "<!-- <suite> -->", "suite", "\0"],
)
def test_other_files_are_none(tmp_path, text):
    """Another XML file is not collected."""
    file = tmp_path / "s.xml"
    file.write_text(text, encoding="utf-8")
    assert not is_suite(file)


def test_folder_and_missing_file_are_none(tmp_path):
    """A folder or missing file is no suite, without an error."""
    assert not is_suite(tmp_path)
    assert not is_suite(tmp_path / "gone.xml")


@settings(deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_looked_at_without_harm(tmp_path_factory, data):
    """Any bytes are checked without an exception."""
    file = tmp_path_factory.getbasetemp() / "any.xml"
    file.write_bytes(data)
    assert is_suite(file) in (True, False)


@settings(deadline=None)
@given(st.text(min_size=1, max_size=30))
def test_marker_of_a_tag_can_be_selected(text):
    """The marker of any tag can be selected by ``-m``."""
    from _pytest.mark.expression import Expression

    name = marker_name(text)
    assert Expression.compile(f"not not {name}").evaluate(lambda word, **_: word == name)
    assert not name.startswith("_")


def test_named_file_is_collected_and_nothing_is_run(lab):
    """A named suite is collected; ``--collect-only`` leaves no files."""
    finished = lab.run(lab.suite(FINE), "--collect-only", "-q")
    assert finished.out.splitlines()[0] == "s.xml::a-fine-one"
    assert not (lab.folder / "rtf-runs").exists()


@pytest.mark.parametrize(("arguments", "expected"), [((), 5), (("--rtf",), 0), (("-o", "rtf_suites=true"), 0)])
def test_folders_have_suites_only_where_that_was_asked_for(lab, arguments, expected):
    """Suites in folders are collected only with the option; other XML files never are."""
    lab.suite(FINE)
    lab.write(report__xml="<testsuites/>")
    finished = lab.run("--collect-only", "-q", *arguments)
    assert finished.exit_code == expected, finished.out
    assert ("s.xml::a-fine-one" in finished.out) is (expected == 0)
    assert "report.xml" not in finished.out


def test_errors_of_a_file_are_written_as_by_a_compiler(lab):
    """Errors of a suite are reported with their places, and it is not collected."""
    lab.write(bad__xml='<suite name="s">\n  <test name="a" retrys="2"> Fine </test>\n  <test name="b"/>\n</suite>\n')
    finished = lab.run("bad.xml")
    assert finished.exit_code == pytest.ExitCode.INTERRUPTED
    assert "bad.xml:3:3: error: " in finished.out
    assert "Traceback" not in finished.out
    assert "ERROR bad.xml" in finished.out


def test_doubts_about_a_file_are_warnings(lab):
    """Warnings of a suite are pytest's warnings, and it runs."""
    finished = lab.run(lab.suite('<test name="a" reason="none"> Fine </test>'))
    assert finished.exit_code == 0, finished.out
    assert "SuiteFileWarning: s.xml:2:" in finished.out


def test_leniently_a_file_of_its_own_words_is_run(lab):
    """With the lenient option unknown attributes are warnings."""
    suite = lab.suite('<test name="a" retrys="2"> Fine </test>')
    assert lab.run(suite, "--collect-only").exit_code == pytest.ExitCode.INTERRUPTED
    for lenient in (["--rtf-lenient"], ["-o", "rtf_lenient=true"]):
        finished = lab.run(suite, *lenient)
        assert finished.exit_code == 0, finished.out
        assert "did you mean 'retries'?" in finished.out


NOD = """
from rtf.testing import Matrix, Parameter, TestCase
class Nod(TestCase):
    speed = Parameter(int, "speed", default=0)
    part = Parameter(str, "part", default="")
    matrix = Matrix(speed=(10, 20), part=("head", "torso"))
    def run(self): pass
class Shake(Nod): matrix = None
class Turn(Nod): matrix = None
"""


def test_matrices_and_classes_are_items_with_the_ids_of_pytest(lab):
    """Matrices and classes are items with pytest's ids, selected by ``-k``."""
    lab.write(nod__py=NOD)
    suite = lab.suite('<test class="Nod"> nod.py </test><test name="both"> nod.py </test>')
    listed = lab.run(suite, "--collect-only", "-q").out.split("\n\n")[0].splitlines()
    parts = [f"{speed}-{part}" for speed in (10, 20) for part in ("head", "torso")]
    assert listed == [f"s.xml::{name}" for name in (*(f"nod.Nod[{part}]" for part in parts), "both.Shake", "both.Turn")]
    assert lab.run(suite, "-k", "nod.Nod[10-head]").last_line.startswith("1 passed")
    assert "s.xml::nod.Nod[head]" in lab.run(suite, "--collect-only", "-q", "--rtf-set", "speed=5").out


HOSTILE = ("twice", "twice", "a::b", "x[1]", "line&#10;end", "()", "&lt;script&gt;", "ärm ∞", "a and b", "../up")


def test_hostile_names_are_unique_and_can_be_selected(lab):
    """Each listed id is unique and can be selected, whatever the name."""
    lab.suite("".join(f'<test name="{name}"> Fine </test>' for name in HOSTILE))
    listed = lab.run("s.xml", "--collect-only", "-q").out.split("\n\n")[0].splitlines()
    assert len({*listed}) == len(HOSTILE)
    assert listed[:2] == ["s.xml::twice", "s.xml::twice+2"]
    finished = lab.run(*listed, "-v")
    assert finished.last_line.startswith(f"{len(HOSTILE)} passed")
    assert [node for node in listed if f"{node} PASSED" not in finished.out] == []


def test_tags_are_markers(lab):
    """Tags are registered markers; a tag named like a marker of pytest gets a prefix."""
    lab.suite(f'<test name="arm"> Measures </test>{FINE}', attributes='tags="bench"')
    quick = lab.run("s.xml", "--strict-markers", "-m", "quick and bench")
    assert quick.last_line.startswith("1 passed, 1 deselected")
    slow = lab.run("s.xml", "--strict-markers", "-m", "slow-arm and tag_skip")
    assert slow.last_line.startswith("1 failed, 1 deselected")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--rtf-set", "speed"), "--rtf-set is 'speed'; it must be of the form NAME=VALUE"),
        (("--rtf-timeout", "soon"), "--rtf-timeout is 'soon'; it must be a duration"),
        (("--rtf-retries", "-1"), "--rtf-retries is '-1', which is out of range; it must be a whole number"),
        (("--rtf-report", "no_such"), "--rtf-report is 'no_such': "),
        (("-o", "rtf_retries=many"), "ini value rtf_retries is 'many'; it must be a whole number"),
    ],
)
def test_wrong_values_are_refused_before_anything_runs(lab, arguments, said):
    """An invalid option is refused with option, value and hint."""
    finished = lab.run(lab.suite(FINE), *arguments)
    assert finished.exit_code == pytest.ExitCode.USAGE_ERROR
    assert f"ERROR: {said}" in finished.out


def test_sessions_without_suites_load_nothing(pytester: pytest.Pytester, monkeypatch):
    """Without suites only the small module of the plug-in is loaded."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    pytester.makepyfile(
        """
        import sys

        def test_modules():
            assert [name for name in sorted(sys.modules) if name.split(".")[0] == "rtf"] == ["rtf", "rtf.pytest_plugin"]
        """
    )
    (pytester.path / "other.xml").write_text("<testsuites/>")
    result = pytester.runpytest_subprocess("-p", "rtf.pytest_plugin")
    result.assert_outcomes(passed=1)
    result.stdout.no_fnmatch_line("*robot tests*")


def test_suites_and_python_tests_are_one_session(pytester: pytest.Pytester, monkeypatch):
    """A suite and a Python module run in one session."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    plug = "from rtf.testing import TestCase\nclass Plug(TestCase):\n    def run(self): self.check(True, 'fine')"
    pytester.makepyfile(test_one="def test_one(): pass", plug=plug)
    (pytester.path / "s.xml").write_text('<suite name="s"><test name="two"> plug.py </test></suite>')
    result = pytester.runpytest_subprocess("-p", "rtf.pytest_plugin", "--rtf", "-v")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["s.xml::two PASSED*", "test_one.py::test_one PASSED*"])


@pytest.mark.skipif(
    not [entry for entry in entry_points(group="pytest11") if entry.value == "rtf.pytest_plugin"],
    reason="this installation has no entry point for pytest",
)
def test_installed_plug_in_is_there_unasked(pytester: pytest.Pytester):
    """An installed RTF adds its options to pytest."""
    result = pytester.run(sys.executable, "-m", "pytest", "--help")
    result.stdout.fnmatch_lines(["robot testing (rtf):*"])
