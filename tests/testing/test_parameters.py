"""Declared parameters: sources, their order, and all problems in one error."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle
from rtf.testing.case import TestCase
from rtf.testing.parameters import Parameter, ParameterError


class Limits(TestCase):
    """A test with a parameter of each kind."""

    ignored_keys = ("plotString1",)

    part = Parameter(str, "part of the robot")
    joints = Parameter(list[int], "joints", default=[0, 1, 2], low=0)
    speed = Parameter(list[float], "speeds", unit="deg/s", default=20.0, low=1.0, high=100.0, length="joints")
    cycles = Parameter(int, "how often", default=10, low=1, aliases=("repeats",))
    plot = Parameter(bool, "whether to plot", default=False)
    mode = Parameter(str, "control mode", default="position", choices=("position", "torque"))
    ports = Parameter(Bottle, "a section as it is", default=Bottle(), key="PORTS")


def resolve(param: str = "--part arm", **layers: object) -> tuple[Limits, dict[str, dict[str, str]]]:
    """Resolve the parameters of a new test; return it with its rows by name."""
    test = Limits()
    rows = test.resolve_parameters(param=param, **layers)
    return test, {row["name"]: row for row in rows}


def problems(param: str, **layers: object) -> list[str]:
    """Return the problems of resolving."""
    with pytest.raises(ParameterError) as caught:
        Limits().resolve_parameters(param=param, **layers)
    return list(caught.value.problems)


def test_private_names_of_the_base_class_are_refused():
    """A plug-in that defines one would change what a method of the base class does."""
    with pytest.raises(TypeError, match="Mine defines _compare, which TestCase uses itself; give it another name"):
        type("Mine", (Limits,), {"_compare": lambda: None})
    assert type("Mine", (Limits,), {"_own": lambda: None})


def test_defaults_hold_without_values():
    """Without a value the default counts, for each element of a list, and its source is default."""
    test, rows = resolve()
    assert test.joints == [0, 1, 2]
    assert test.speed == [20.0, 20.0, 20.0]
    assert rows["speed"] == {"name": "speed", "value": "(20 20 20)", "unit": "deg/s", "source": "default"}


def test_later_layers_win_and_are_named(tmp_path: Path):
    """Values are from default, file, param, <parameter> and --set, the last one counts, with its source."""
    (tmp_path / "limits.ini").write_text("part torso\ncycles 2\nmode torque\njoints (0 1)\nspeed (5 6)\n")
    test, rows = resolve(
        "--from limits.ini --cycles 3",
        parameters=(("cycles", "4"), ("plot", "true")),
        overrides=(("plot", "false"), ("name", "Left Arm")),
        place="suite.xml:7",
        folder=str(tmp_path),
    )
    assert (test.part, test.cycles, test.mode, test.plot, test.speed) == ("torso", 4, "torque", False, [5.0, 6.0])
    assert test.name == "Left Arm"
    assert rows["part"]["source"].endswith("limits.ini:1")
    assert rows["cycles"]["source"] == "<parameter> of suite.xml:7"
    assert rows["plot"]["source"] == "--set"


def test_bare_values_and_sections_are_lists(tmp_path: Path):
    """Several values on a line are a list, and a section is a bottle."""
    (tmp_path / "limits.ini").write_text("part arm\njoints 0 1\nspeed 5 6\n[PORTS]\n/icub/head 50 5\n")
    test, _ = resolve("--from limits.ini", folder=str(tmp_path))
    assert test.joints == [0, 1]
    assert test.ports.to_text() == "(/icub/head 50 5)".replace("/icub/head", '"/icub/head"')


def test_a_misspelt_key_is_an_error_with_a_suggestion():
    """An unknown key is a problem with the nearest name."""
    assert problems("--part arm --sped 3") == ["unknown parameter 'sped' (param); did you mean 'speed'?"]


@pytest.mark.parametrize("param", ["part leg joints (0 1)", "part leg joints (0 1) --part arm"])
def test_words_before_the_first_key_are_not_dropped(param: str):
    """Words before the first key are a problem with a hint."""
    assert "'part leg joints (0 1)' belongs to no key (param); write --KEY VALUE, as in --part leg joints (0 1)" in (
        problems(param)
    )


class Hosts(TestCase):
    """A test with a parameter for words before the first key."""

    words_key = "hosts"

    hosts = Parameter(list[str], "machines", default=[])


@pytest.mark.parametrize("param", ["pc104 icub@icub16", "--hosts pc104 icub@icub16"])
def test_words_before_the_first_key_may_have_one(param: str):
    """A test can take words before the first key; a written key takes precedence."""
    test = Hosts()
    test.resolve_parameters(param=param)
    assert test.hosts == ["pc104", "icub@icub16"]
    test.resolve_parameters(param="pc104 --hosts icub17")
    assert test.hosts == ["icub17"]


def test_wrong_case_is_recognised():
    """A key in the wrong case is a problem that names the right one."""
    assert problems("--Part arm")[0] == "unknown parameter 'Part' (param); did you mean 'part'?"


def test_keys_that_mean_nothing_any_more_may_be_listed():
    """A test can list old keys that are ignored."""
    test, _ = resolve("--part arm --plotString1 x")
    assert test.part == "arm"


def test_every_problem_is_reported_at_once():
    """One error has all problems."""
    found = problems('--joints "(0 1)" --speed "(5 6 7)" --cycles 0 --mode tork --plot maybe')
    assert found == [
        "cycles: 0 is not at least 1 (param)",
        "mode: 'tork' is none of 'position', 'torque'; did you mean 'torque'? (param)",
        "plot: maybe is no truth value: write true or false (param)",
        "part: must be given (text; part of the robot)",
        "speed: has 3 values, must have 2 (as many as joints) (param)",
    ]


def test_a_short_list_is_an_error_and_not_zeros():
    """A list that is too short is a problem, unlike in the C++ framework, which fills it with zeros."""
    assert problems('--part arm --speed "(20 20)"') == [
        "speed: has 2 values, must have 3 (as many as joints) (param)",
    ]


def test_a_text_without_quotes_is_explained():
    """Several words for a text are a problem with a hint to quotes."""
    (found,) = problems("--part left arm")
    assert "put a text with blanks in quotes" in found


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("crash - delay=1", "crash - delay=1"),
        ("007", "007"),
        ('say "no" twice', 'say "no" twice'),
        ('"left arm"', "left arm"),
        ('""', ""),
        ("(head torso)", "(head torso)"),
    ],
)
@pytest.mark.parametrize("layer", ["parameters", "overrides"])
def test_a_text_that_stands_alone_is_taken_as_it_is(layer: str, written: str, meant: str):
    """A single text is taken unchanged; quotes around the whole are removed."""
    test, _ = resolve("", **{layer: (("part", written),)})
    assert test.part == meant


@pytest.mark.parametrize(
    ("key", "written", "said"),
    [
        ("cycles", "1.5", "1.5 is no whole number"),
        ("cycles", "1 2", "is one whole number, not 2 values"),
        ("speed", "fast", "element 0: fast is no number"),
        ("plot", "maybe", "maybe is no truth value: write true or false"),
        ("part", "", "has no value"),
    ],
)
def test_types_are_named_in_words(key: str, written: str, said: str):
    """A wrong type is a problem in plain words."""
    (found,) = problems("" if key == "part" else "--part arm", parameters=((key, written),))
    assert found == f"{key}: {said} (<parameter>)"


def test_a_file_whose_rest_is_lost_is_an_error(tmp_path: Path):
    """A file with an unclosed bracket is an error with its line."""
    (tmp_path / "limits.ini").write_text("part torso\njoints (0 1\nspeed (5 6)\n")
    with pytest.raises(ParameterError, match=r"limits\.ini:2.* never closed") as caught:
        Limits().resolve_parameters(param="--from limits.ini", folder=str(tmp_path))
    assert str(caught.value).count("limits.ini:2") == 1


def test_what_reading_a_file_warns_of_has_its_place_once(tmp_path: Path):
    """A warning of a file has its place once."""
    (tmp_path / "limits.ini").write_text("part x$NOWHERE\n")
    test = Limits()
    test.resolve_parameters(param="--from limits.ini", folder=str(tmp_path))
    (warning,) = test.parameter_warnings
    assert warning.count("limits.ini:1") == 1


def test_nan_is_outside_every_range():
    """NaN is outside of every range."""
    (found,) = problems('--part arm --joints "(0)" --speed "(nan)"')
    assert "nan is not within" in found


def test_a_missing_file_lists_the_places(tmp_path: Path):
    """The error about a missing file lists the searched places."""
    with pytest.raises(FileNotFoundError) as caught:
        Limits().resolve_parameters(param="--from nowhere.ini --part arm", folder=str(tmp_path))
    assert "nowhere.ini: not found" in str(caught.value)
    assert "RobotTesting" in str(caught.value)


def test_a_declaration_of_an_unknown_type_or_unit_is_refused():
    """A parameter of an unknown type or unit raises an error when it is declared."""
    with pytest.raises(TypeError, match="a parameter is a bool"):
        Parameter(complex, "no such type")
    with pytest.raises(ValueError, match="did you mean"):
        Parameter(float, "no such unit", unit="degs")


def test_inherited_declarations_count():
    """Declarations are inherited."""

    class Derived(Limits):
        extra = Parameter(int, "one more", default=1)

    assert [*Derived.declarations()][-1] == "extra"
    assert "part" in Derived.declarations()


@given(st.lists(st.integers(0, 50), max_size=8), st.floats(1.0, 100.0))
def test_what_is_written_is_what_is_read(joints: list[int], speed: float):
    """A valid list has the values that were written."""
    written = " ".join(map(str, joints))
    speeds = " ".join(repr(speed) for _ in joints)
    test, _ = resolve(f'--part arm --joints "({written})" --speed "({speeds})"')
    assert test.joints == joints
    assert test.speed == [speed] * len(joints)


@given(st.text(max_size=60))
def test_no_string_breaks_the_filling(text: str):
    """Any parameter string gives values or ParameterError."""
    with pytest.raises(ParameterError):  # the part that must be given is never given by such a string
        Limits().resolve_parameters(param=text.replace("--from", "--form").replace("--part", "--prat"))
