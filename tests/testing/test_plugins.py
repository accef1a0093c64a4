"""Finding and loading plug-ins by file, name and search path."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtf.testing.plugin_makers import load_test
from rtf.testing.plugins import PluginError, PluginNotFoundError, find, spec_of

NATIVE = '''
from rtf.testing import TestCase
class JointLimits(TestCase):
    """Sweeps the limits."""
    plugin_name = "joint-limits"
    aliases = ("JointLimitsTest", "limits")
    tags = ("motion",)
    requires = ("program:sh",)
    timeout = 12
    def run(self): pass
'''


@pytest.fixture(autouse=True)
def no_other_places(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Search only the folders of the test, and the shipped ones."""
    monkeypatch.delenv("RTF_PLUGIN_PATH", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A suite's folder with one plug-in."""
    suite = tmp_path / "suite"
    suite.mkdir()
    (suite / "limits_of_joints.py").write_text(NATIVE)
    return suite


@pytest.mark.parametrize(
    "name",
    [
        "limits_of_joints.py",
        "limits_of_joints",
        "JointLimits",
        "joint-limits",
        "JointLimitsTest",
        "JointLimits.so",
        "JointLimits.dll",
    ],
)
def test_a_plugin_answers_to_file_class_name_and_aliases(folder: Path, name: str):
    """File, class, declared name and aliases find the same plug-in."""
    ref = find("test", name, beside=folder)
    assert ref.path == str(folder / "limits_of_joints.py")
    assert type(load_test(ref)).__name__ == "JointLimits"


def test_dll_means_the_python_plugin_that_declares_the_name(folder: Path):
    """The type dll of old suites finds the Python plug-in of that name."""
    assert find("test", "JointLimitsTest", "dll", beside=folder).language == "python"


def test_facts_are_known_without_running_the_file(folder: Path):
    """Tags, requirements and time-out are read from the text without running it."""
    (folder / "limits_of_joints.py").write_text(NATIVE + "\nraise SystemExit('must not be run')\n")
    spec = spec_of(find("test", "JointLimits", beside=folder))
    assert (spec.tags, spec.requires, spec.timeout) == (("motion",), ("program:sh",), 12.0)
    assert spec.summary == "Sweeps the limits."


def test_private_classes_are_no_plugins(folder: Path):
    """Private classes beside a test are no plug-ins."""
    private = "\nfrom typing import NamedTuple\nclass _Side(NamedTuple):\n    sign: int\n"
    (folder / "limits_of_joints.py").write_text(NATIVE.replace("timeout = 12", "safety = Safety.MOTION") + private)
    spec = spec_of(find("test", "limits_of_joints.py", beside=folder))
    assert (spec.class_name, spec.safety) == ("JointLimits", "motion")
    with pytest.raises(PluginNotFoundError):
        find("test", "_Side", beside=folder)


BASES = """
import abc, enum
from typing import NamedTuple, Protocol
from rtf.testing import TestCase
from rtf.testing.case import TestCase as Case
from rtf.robot_testing import RobotTest, Safety
from rtf.robot_testing.stream_test import RateTest
from elsewhere import Other
import rtf.testing
class _Own(RobotTest):
    safety = Safety.MOTION
class _Mixed(TestCase):
    def helper(self):
        safety = 1
"""


@pytest.mark.parametrize(
    ("text", "safety"),
    [
        ("class T(TestCase): pass", ""),
        ("class T(Case): pass", ""),
        ("class T(rtf.testing.TestCase): pass", ""),
        ("class T(_Mixed): pass", ""),
        ("class T(_Mixed, abc.ABC): pass", ""),
        ("class T(TestCase): safety = 'motion'", "motion"),
        ("class T(TestCase): safety: str = 'Effort'", "effort"),
        ("class T(RobotTest): safety = Safety.FAULT", "fault"),
        ("class T(RobotTest): pass", "still"),
        ("class T(RateTest): pass", "still"),
        ("class T(_Own): pass", "motion"),
        ("class T(_Own): safety = Safety.STILL", "still"),
        ("class T(_Own, RateTest): pass", None),
        ("class T(Other): pass", None),
        ("class T(Other): safety = Safety.STILL", "still"),
        ("class T(TestCase, Other): pass", None),
        ("SAFE = Safety.MOTION\nclass T(TestCase): safety = SAFE", None),
        ("class T(TestCase):\n  if True: safety = 'motion'", None),
        ("class T(TestCase):\n  safety = 'still'\n  safety = 'motion'", None),
        ("class T(TestCase):\n  @property\n  def safety(self): return 'motion'", None),
        ("class T(TestCase): safety, other = 'still', 1", None),
        ("if True:\n  class T(TestCase): pass", None),
        ("class T: pass", None),
        ("class T(TestCase: pass", None),
    ],
)
def test_what_a_test_does_to_its_surroundings_is_read_or_unknown(folder: Path, text: str, safety: str | None):
    """The safety class is read from the class and its known bases, or is unknown."""
    (folder / "t.py").write_text(f"{BASES}{text}\n")
    assert spec_of(find("test", "t.py", beside=folder)).safety == safety


@pytest.mark.parametrize("bases", ["NamedTuple", "Protocol", "enum.IntEnum", "ValueError", "abc.ABC, dict", "Helper"])
def test_classes_of_python_beside_a_test_are_no_plugins(folder: Path, bases: str):
    """Classes without a base of tests are no plug-ins."""
    helper = "class Helper(NamedTuple): value: int\n" if bases == "Helper" else ""
    (folder / "t.py").write_text(f"{BASES}{helper}class Step({bases}): pass\nclass T(_Own): pass\n")
    assert spec_of(find("test", "t.py", beside=folder)).safety == "motion"
    with pytest.raises(PluginNotFoundError):
        find("test", "Step", beside=folder)


def test_programs_and_scripts_declare_nothing(folder: Path):
    """Programs and Lua scripts have no safety class."""
    (folder / "t.lua").write_text("return {}")
    assert spec_of(find("test", "t.lua", beside=folder)).safety == ""
    assert spec_of(find("test", "true", "executable", beside=folder)).safety == ""


@pytest.mark.parametrize(("name", "type_"), [("sweep.lua", None), ("sweep.lua", "lua"), ("sweep", "lua")])
def test_an_alias_may_be_the_name_of_a_script_in_lua(folder: Path, name: str, type_: str | None):
    """A script's name finds the script, or the Python plug-in with that alias."""
    (folder / "limits_of_joints.py").write_text(NATIVE.replace('"limits"', '"sweep.lua"'))
    ref = find("test", name, type_, beside=folder)
    assert (Path(ref.path).name, ref.language) == ("limits_of_joints.py", "python")
    assert type(load_test(ref)).__name__ == "JointLimits"
    (folder / "sweep.lua").write_text("return {}")
    assert find("test", name, type_, beside=folder).language == "lua"


def test_the_suites_folder_comes_before_the_plugin_path(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The suite's folder is searched before RTF_PLUGIN_PATH."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "limits_of_joints.py").write_text(NATIVE)
    (other / "elsewhere.py").write_text(NATIVE)
    monkeypatch.setenv("RTF_PLUGIN_PATH", str(other))
    assert find("test", "limits_of_joints", beside=folder).path.startswith(str(folder))
    assert find("test", "elsewhere", beside=folder).path.startswith(str(other))


def test_what_is_not_found_says_where_it_was_looked_for(folder: Path):
    """The error about a missing plug-in lists the searched places and a near name."""
    with pytest.raises(PluginNotFoundError) as caught:
        find("test", "JointLimit", beside=folder)
    assert "did you mean JointLimits" in str(caught.value)
    assert any(str(folder) in place for place in caught.value.tried)
    assert any("entry points" in place for place in caught.value.tried)


def test_a_wrong_case_is_suggested_first(folder: Path):
    """A name in the wrong case is not found, and the right one is suggested."""
    with pytest.raises(PluginNotFoundError, match=r"did you mean JointLimits\b"):
        find("test", "jointlimits", beside=folder)


def test_an_unknown_type_lists_the_known_ones(folder: Path):
    """The error about an unknown type lists the known ones."""
    with pytest.raises(PluginNotFoundError, match=r"types are .*gtest.*lua.*python"):
        find("test", "JointLimits", "pyton", beside=folder)


def test_a_program_must_be_executable(folder: Path):
    """A file that is not executable is an error with a hint."""
    script = folder / "probe.sh"
    script.write_text("#!/bin/sh\n")
    with pytest.raises(PluginNotFoundError, match=r"chmod \+x"):
        find("test", "probe.sh", beside=folder)
    script.chmod(0o755)
    assert find("test", "probe.sh", beside=folder).language == "executable"


def test_a_program_on_the_path_is_found_by_type(folder: Path):
    """PATH is searched only with a type for programs."""
    assert find("test", "sh", "exit", beside=folder).language == "executable:exit"
    with pytest.raises(PluginNotFoundError):
        find("test", "sh", beside=folder)


def test_two_classes_and_no_name_is_an_error(folder: Path):
    """Loading a file with two classes and without a class's name is an error."""
    (folder / "two.py").write_text(
        "from rtf.testing import TestCase\nclass A(TestCase):\n  pass\nclass B(TestCase):\n  pass\n",
    )
    with pytest.raises(PluginError, match="found: A, B"):
        load_test(find("test", "two.py", beside=folder))
    assert type(load_test(find("test", "B", beside=folder))).__name__ == "B"


def test_a_base_class_beside_its_only_leaf_is_no_doubt(folder: Path):
    """A base class with one derived test is not ambiguous."""
    (folder / "family.py").write_text(
        "from rtf.testing import TestCase\nclass Base(TestCase):\n  pass\nclass Leaf(Base):\n  pass\n",
    )
    assert type(load_test(find("test", "family.py", beside=folder))).__name__ == "Leaf"


def test_a_module_is_named_for_its_kind_and_stem(folder: Path):
    """A plug-in's module has a name that shadows no other package."""
    test = load_test(find("test", "JointLimits", beside=folder))
    assert type(test).__module__ == "rtf_plugins.test.limits_of_joints"


def test_a_file_may_import_its_neighbour(folder: Path):
    """A plug-in can import a module beside it."""
    (folder / "a_helper_of_ours.py").write_text("VALUE = 42\n")
    (folder / "user.py").write_text(
        "import a_helper_of_ours\nfrom rtf.testing import TestCase\n"
        "class User(TestCase):\n  value = a_helper_of_ours.VALUE\n",
    )
    assert load_test(find("test", "User", beside=folder)).value == 42


def test_a_syntax_error_keeps_its_place(folder: Path):
    """A syntax error in a plug-in has its file."""
    (folder / "wrong.py").write_text("class X(\n")
    with pytest.raises(SyntaxError) as caught:
        load_test(find("test", "wrong.py", beside=folder))
    assert caught.value.filename == str(folder / "wrong.py")
