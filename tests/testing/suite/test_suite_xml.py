"""Loading suite files: what each element means, and what is said about the faulty ones."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.testing.suite.model import Expected, Isolation, LostPolicy, Scope, TestEntry, TestSuite, Timeouts
from rtf.testing.suite.xml import LoadedSuite, load_suite, load_suite_bytes
from rtf.testing.verdict import Severity

DATA = Path(__file__).parents[2] / "data" / "suites"


def load(text: str, file: str = "s.xml", **variables: str) -> LoadedSuite:
    """Load a suite from a text."""
    return load_suite_bytes(text.encode(), file, variables=variables)


def sound(body: str, attributes: str = 'name="S"', **variables: str) -> TestSuite:
    """Load a suite that must have nothing wrong with it."""
    loaded = load(f"<suite {attributes}>{body}</suite>", **variables)
    assert loaded.diagnostics == ()
    return loaded.suite


def problems(body: str, attributes: str = 'name="S"') -> list[str]:
    """What is said about a suite with this content."""
    return [str(diagnostic) for diagnostic in load(f"<suite {attributes}>{body}</suite>").diagnostics]


def entry_of(suite: TestSuite, test_id: str) -> TestEntry:
    """The test with this id."""
    (found,) = [test for test in suite.tests if test.id == test_id]
    return found


def plugins(suite: TestSuite) -> list[str]:
    """The plug-ins of a suite's tests, in order."""
    return [test.plugin for test in suite.tests]


# --- the C++ framework's meaning --------------------------------------------------------------------------------------


def test_tests_run_in_file_order():
    """Order of execution is file order."""
    assert plugins(sound("<test> C </test><test>A</test><test>\n B\n</test>")) == ["C", "A", "B"]


def test_element_names_are_compared_without_case():
    """An old file may shout."""
    assert plugins(load('<SUITE name="S"><Test>A</Test></SUITE>').suite) == ["A"]


def test_attribute_names_are_compared_with_case():
    """PARAM is not param, and it is said."""
    loaded = load('<suite name="S"><test PARAM="x">A</test></suite>')
    assert loaded.suite.tests[0].param == ""
    assert "<test> has no attribute 'PARAM'" in loaded.diagnostics[0].text
    assert loaded.diagnostics[0].hint == "did you mean 'param'?"


def test_white_space_in_text_is_condensed():
    """Line breaks in a description are none."""
    assert sound("<description>\n two\tprobes\n  here </description>").description == "two probes here"


def test_an_environment_is_given_to_the_tests_that_follow():
    """The last one before a test wins; an empty one empties."""
    body = "<environment>a</environment><test>A</test><environment/><test>B</test>"
    body += "<environment>c</environment><test>C</test>"
    loaded = load(f'<suite name="S">{body}</suite>')
    assert [test.environment for test in loaded.suite.tests] == ["a", "", "c"]
    assert loaded.suite.environment == "c"


def test_a_test_before_the_environment_is_a_trap_and_is_pointed_at():
    """The author most likely meant it for all tests."""
    loaded = load('<suite name="S"><test>A</test>\n<environment>e</environment><test>B</test></suite>')
    assert [test.environment for test in loaded.suite.tests] == ["", "e"]
    (warning,) = loaded.diagnostics
    assert "too late for 1 test above it" in warning.text
    assert warning.line == 2
    assert loaded.errors == ()


def test_a_test_with_its_own_environment_is_no_trap():
    """It asks for nothing from the suite."""
    suite = sound("<test>A<environment>own</environment></test><environment>e</environment><test>B</test>")
    assert [test.environment for test in suite.tests] == ["own", "e"]


def test_repetition_counts_additional_runs():
    """The C++ framework lost every test that had one."""
    assert sound('<test repetition="4">A</test>').tests[0].repetition == 4


def test_a_comment_in_front_of_the_text_does_not_lose_the_test():
    """The C++ framework lost such a test silently."""
    assert plugins(sound("<test><!-- which --> A <!-- and --> B</test>")) == ["A B"]


def test_dashes_in_comments_are_forgiven_with_a_warning():
    """Old files comment options out; lines and columns of what follows stay true."""
    loaded = load('<suite name="S">\n<!-- --from x.ini --->\n<!----><!-- é -- --><test x="">A</test></suite>')
    assert plugins(loaded.suite) == ["A"]
    comment, attribute = loaded.diagnostics
    assert "this comment (and 1 more) contains '--'" in comment.text
    assert (comment.line, comment.column) == (2, 1)
    assert (attribute.line, attribute.column) == (3, 27)


def test_a_suite_without_a_name_is_unknown():
    """As in the C++ framework, but it is said."""
    loaded = load("<suite><test>A</test></suite>")
    assert (loaded.suite.name, loaded.suite.tests[0].id) == ("unknown", "unknown/A")
    assert [one.severity for one in loaded.diagnostics] == [Severity.WARNING]


def test_a_suite_without_tests_is_a_suite():
    """What to do about it is the runner's business."""
    assert sound("").tests == ()


# --- names and ids ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("element", "name", "test_id"),
    [
        ("<test>CameraTest</test>", "CameraTest", "s/CameraTest"),
        (
            '<test param="--from camera_left.ini">CameraTest</test>',
            "CameraTest [camera_left]",
            "s/CameraTest[camera_left]",
        ),
        ('<test param="--x --from &quot;a/my arm.ini&quot;">T.py</test>', "T [my arm]", "s/T[my-arm]"),
        ('<test param="--fromage x.ini">T</test>', "T", "s/T[fromage-x.ini]"),
        ('<test name="left eye" param="--from x.ini">T</test>', "left eye", "s/left-eye"),
        ("<test>dir/check.sh</test>", "check", "s/check"),
    ],
)
def test_a_test_is_named_after_what_tells_it_apart(element: str, name: str, test_id: str):
    """Its name, else the plug-in's stem and the parameter file."""
    test = sound(element).tests[0]
    assert (name, test_id) == (test.name, test.id)


def test_equal_names_are_numbered_in_file_order():
    """Ids stay unique and stable."""
    suite = sound("<test>A</test><test>B</test><test>A</test><test>A</test>")
    assert [test.id for test in suite.tests] == ["s/A", "s/B", "s/A+2", "s/A+3"]


def test_a_faulty_test_keeps_its_number():
    """Mending it renames no other test."""
    loaded = load('<suite name="S"><test retries="x">A</test><test>A</test></suite>')
    assert [test.id for test in loaded.suite.tests] == ["s/A+2"]


# --- loops and variables ----------------------------------------------------------------------------------------------


def test_loops_in_loops_give_every_combination():
    """The outer loop turns slower."""
    suite = sound(
        '<for name="part" in="left_arm right_arm">'
        '<for name="v" in="1 2"><test param="--p ${part} ${v}">J</test></for></for>',
    )
    assert [f"--p {part} {v}" for part in ("left_arm", "right_arm") for v in "12"] == [t.param for t in suite.tests]
    assert suite.tests[0].name == "J [left_arm 1]"


def test_loop_variables_reach_every_attribute_and_text():
    """Names, plug-ins, numbers, parameters, requirements."""
    suite = sound(
        '<test>pre</test><for name="n" in="1 2">'
        '<test name="t${n}" timeout="${n}0" tags="tag${n}" requires="test:pre env:E${n}">'
        'P${n}<parameter name="p${n}">v${n}</parameter><environment>e${n}</environment></test></for>',
    )
    test = suite.tests[2]
    assert (
        test.name,
        test.timeouts.run,
        test.tags,
        test.plugin,
        test.parameters,
        test.environment,
    ) == ("t2", 20, ("tag2",), "P2", (("p2", "v2"),), "e2")
    assert test.requires == ("test:s/pre", "env:E2")


def test_values_in_quotes_keep_their_blanks():
    """And commas do not separate them."""
    suite = sound("""<for name="v" in="'a b' c,d"><test>T</test></for>""")
    assert [test.name for test in suite.tests] == ["T [a b]", "T [c,d]"]


def test_an_inner_loop_may_use_the_outer_variable():
    """Its values are read anew in each round."""
    suite = sound('<for name="a" in="x y"><for name="b" in="${a}1 ${a}2"><test name="${b}">T</test></for></for>')
    assert [test.name for test in suite.tests] == ["x1", "x2", "y1", "y2"]


def test_unknown_variables_stay_for_the_test_to_resolve():
    """The robot's name is known only later."""
    suite = sound('<environment>${robotname}</environment><test param="${robotname} ${v}">T</test>', v="5")
    assert (suite.tests[0].param, suite.environment) == ("${robotname} 5", "${robotname}")


def test_values_are_not_looked_into_again():
    """What a value contains is text."""
    assert sound('<test param="${a}">T</test>', a="${b}", b="no").tests[0].param == "${b}"


@pytest.mark.parametrize(
    ("loop", "message"),
    [
        ('<for in="a"><test>T</test></for>', "'' cannot be the name of a loop variable"),
        ('<for name="1" in="a"><test>T</test></for>', "'1' cannot be the name of a loop variable"),
        ('<for name="a"><test>T</test></for>', "this <for> has no values"),
        ('<for name="a" in=" "><test>T</test></for>', "this <for> has no values"),
        ("""<for name="a" in="'x"><test>T</test></for>""", "quote (') that is never closed"),
    ],
)
def test_a_loop_that_cannot_turn_is_an_error(loop: str, message: str):
    """Its tests would be lost silently otherwise."""
    (problem,) = problems(loop)
    assert "error: " in problem
    assert message in problem


# --- defaults and attributes ------------------------------------------------------------------------------------------


def test_a_full_file_is_understood_to_the_last_attribute():
    """Suite defaults, overrides, fixtures in starting order, an included part."""
    suite = load_suite(DATA / "arms.xml").suite
    assert (
        suite.name,
        suite.timeout,
        suite.tags,
        suite.preload,
    ) == ("Arms and cameras", 600, ("nightly", "safe"), ("numpy", "rtf.robot"))
    assert Timeouts(setup=5, run=20, teardown=0.5, total=3600) == suite.timeouts
    assert [fixture.name for fixture in suite.fixtures] == ["simulator", "robot", "treadmill"]
    cameras, drift = (entry_of(suite, f"arms-and-cameras/{name}") for name in ("cameras", "drift"))
    assert Timeouts(setup=2, run=90, teardown=3, total=120) == cameras.timeouts
    assert (
        cameras.tags,
        cameras.requires,
        cameras.retries,
    ) == (("nightly", "safe", "vision"), ("program:true", "env:HOME"), 1)
    assert (cameras.isolation, cameras.on_lost, cameras.fixtures) == (Isolation.SUITE, LostPolicy.ERROR, ("simulator",))
    assert (
        drift.repetition,
        drift.retries,
        drift.expected,
        drift.expected_reason,
        drift.fixtures,
        drift.type,
        drift.plugin,
        drift.environment,
    ) == (4, 2, Expected.FAIL, "issue 12", (), "executable", "checks/drift", "--robotname icub")


def test_the_fixtures_of_a_full_file_are_understood():
    """Every attribute arrives; a fixture has the parameters written in it and no others."""
    suite = load_suite(DATA / "arms.xml").suite
    simulator, robot, _treadmill = suite.fixtures
    assert (Scope.RUN, 5, 0.25, 0.5, Timeouts(setup=40, teardown=10), None, "--headless", "--seed 3") == (
        simulator.scope,
        simulator.restarts,
        simulator.backoff,
        simulator.check_period,
        simulator.timeouts,
        simulator.on_lost,
        simulator.environment,
        simulator.param,
    )
    assert (("simulator",), 0.2, LostPolicy.RERUN, (("parts", "left_arm right_arm"),), suite.environment) == (
        robot.depends,
        robot.check_period,
        robot.on_lost,
        robot.parameters,
        robot.environment,
    )


def test_suite_parameters_come_first_wherever_they_stand():
    """So that the last of a name, the test's own, wins."""
    suite = sound('<test>A<parameter name="v">2</parameter></test><parameter name="v">1</parameter>')
    assert suite.tests[0].parameters == (("v", "1"), ("v", "2"))


def test_an_included_file_keeps_its_defaults_for_its_own_tests():
    """Its time-out and retries apply to its tests and to no others; tags add up."""
    suite = load_suite(DATA / "arms.xml").suite
    left, right = (entry_of(suite, f"arms-and-cameras/JointLimits[{side}_leg]") for side in ("left", "right"))
    assert (left.timeouts.run, right.timeouts.run, suite.tests[1].timeouts.run) == (99, 7, None)
    assert (left.retries, suite.tests[1].retries) == (0, 1)
    assert left.tags == ("legs", "nightly", "safe")
    assert (suite.environment, "--robotname icub") == (left.environment, right.environment)
    assert Path(left.location.file) == DATA / "parts" / "legs.xml"


@pytest.mark.parametrize(
    ("attribute", "told"),
    [
        ('retries="-1"', "a whole number from 0 to 1000"),
        ('retries="x"', "a whole number from 0 to 1000"),
        ('repetition="1000001"', "a whole number from 0 to 1000000"),
        ('timeout="0"', "a duration from 0.001 s to 2.592e+06 s"),
        ('setup-timeout="soon"', "a duration from 0.001 s"),
        ('isolation="tests"', "did you mean 'test'?"),
        ('expected="maybe"', "one of pass, fail"),
        ('on-lost="retry"', "one of rerun, error, skip"),
        ('tags="a(b"', "'a(b' cannot be a tag"),
        ('requires="env:"', "'env:' names nothing"),
        ('requires="test:\'a"', "never closed"),
    ],
)
def test_a_bad_value_is_an_error_at_its_place_and_keeps_the_test_out(attribute: str, told: str):
    """Never silently, and with what would be right."""
    loaded = load(f'<suite name="S">\n  <test {attribute}>A</test><test>B</test></suite>')
    assert plugins(loaded.suite) == ["B"]
    (error,) = loaded.errors
    assert told in str(error)
    assert (error.line, error.column) == (2, 9)


def test_all_problems_are_told_in_one_go():
    """In file order, each with line and column."""
    loaded = load(
        '<suite name="S" timeuot="5">\n'
        '  <test retries="-1"\n        timeout="x">A</test>\n'
        "  <tset>B</tset>\n  <test/>\n  <fixture restarts='many'>F</fixture>\n  stray\n</suite>",
    )
    assert [(d.line, d.column) for d in loaded.diagnostics] == [
        (1, 1),
        (1, 17),
        (2, 9),
        (3, 9),
        (4, 3),
        (5, 3),
        (6, 12),
    ]


@pytest.mark.parametrize("lenient", [False, True])
@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("<tst>A</tst>", "<suite> has no element <tst>; it is not read (did you mean 'test'?)"),
        ('<test timeot="3">A</test>', "<test> has no attribute 'timeot'; it is not read (did you mean 'timeout'?)"),
        ("<group><test>A</test><test>B</test></group>", "no element <group>; it is not read, and with it 2 tests"),
        ("<description/><group/><group/>", "<suite> has no element <group>; it is not read"),
    ],
)
def test_an_unknown_name_is_an_error_with_a_hint_or_leniently_a_warning(body: str, told: str, lenient: bool):
    """A test, a limit or a whole group would be lost by a slip of the pen."""
    loaded = load_suite_bytes(f'<suite name="S">{body}</suite>'.encode(), "s.xml", lenient=lenient)
    assert told in str(loaded.diagnostics[0])
    assert len(loaded.errors) == (0 if lenient else len(loaded.diagnostics))


def test_what_editors_write_to_find_the_schema_is_no_problem():
    """These attributes belong to XML itself."""
    sound("", 'name="S" xmlns="urn:s" xmlns:xsi="urn:x" xsi:noNamespaceSchemaLocation="suite.xsd" xml:lang="en"')


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("<suite name='T'/>", "use <include> instead"),
        ("<test>A<test>B</test></test>", "it may stand in <for> or <suite>"),
        ('<for name="a" in="b"><fixture>F</fixture></for>', "it may stand in <suite>"),
        ('<for name="a" in="b"><environment>F</environment></for>', "it may stand in <fixture> or <suite> or <test>"),
    ],
)
def test_a_known_element_at_the_wrong_place_is_an_error(body: str, told: str):
    """It was meant, so leaving it out is more than a warning."""
    (problem,) = problems(body)
    assert "error: " in problem
    assert told in problem


def test_expected_failures_want_a_reason():
    """The next reader will ask."""
    assert "without a reason" in problems('<test expected="fail">A</test>')[0]
    assert "without expected" in problems('<test reason="r">A</test>')[0]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<timeout/>", "this <timeout> is empty"),
        ("<timeout>x</timeout>", "<timeout> is 'x'; it must be a duration"),
        ("<timeout>1</timeout><timeout>2</timeout>", "warning: a second <timeout> replaces the first"),
        ("<parameter>1</parameter>", "a <parameter> needs a name"),
        ("<test>A<parameter>1</parameter></test>", "a <parameter> needs a name"),
        ("<fixture> </fixture>", "this <fixture> names no plug-in"),
        ('<fixture name="a b">F</fixture>', "the fixture name 'a b' is not one word"),
    ],
)
def test_other_faults_have_their_messages(body: str, message: str):
    """One problem, one message."""
    (problem,) = problems(body)
    assert message in problem


def test_modules_to_preload_have_names():
    """Anything else would fail much later."""
    assert "'1x' is no name of a Python module" in problems("", 'name="S" preload="numpy 1x"')[0]


# --- properties -------------------------------------------------------------------------------------------------------

WORD = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"], exclude_characters="<>&\"'${}~"), min_size=1)


def escape(text: str) -> str:
    """Write a text so that XML cannot take it for anything else."""
    return "".join(f"&#{ord(char)};" for char in text)


@given(
    st.lists(
        st.tuples(
            WORD,
            st.text(st.characters(codec="utf-8", exclude_categories=["C"]), max_size=20),
            st.integers(0, 1000),
            st.lists(st.text("abc", min_size=1), max_size=3),
        ),
        max_size=8,
    ),
    st.permutations(["left", "right", "torso"]),
)
def test_what_is_written_is_what_is_loaded(tests: list[tuple[str, str, int, list[str]]], values: list[str]):
    """Plug-ins, parameter strings, numbers and tags survive the way through a file, in their order, once per value."""
    body = "".join(
        f'<test param="{escape(param)}" retries="{retries}" tags="{" ".join(tags)}">{escape(plugin)}</test>'
        for plugin, param, retries, tags in tests
    )
    suite = sound(f'<for name="part" in="{" ".join(values)}">{body}</for>')
    expected = [(plugin, param, retries, tuple(sorted(set(tags)))) for plugin, param, retries, tags in tests]
    assert expected * len(values) == [(t.plugin, t.param, t.retries, t.tags) for t in suite.tests]
    assert len({test.id for test in suite.tests}) == len(suite.tests)
