"""Loading suite files: the meaning of each element, and the problems of faulty ones."""

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
    """Load a suite that must have no problem."""
    loaded = load(f"<suite {attributes}>{body}</suite>", **variables)
    assert loaded.diagnostics == ()
    return loaded.suite


def problems(body: str, attributes: str = 'name="S"') -> list[str]:
    """Return the problems of a suite with this content."""
    return [str(diagnostic) for diagnostic in load(f"<suite {attributes}>{body}</suite>").diagnostics]


def entry_of(suite: TestSuite, test_id: str) -> TestEntry:
    """Return the test with this id."""
    (found,) = [test for test in suite.tests if test.id == test_id]
    return found


def plugins(suite: TestSuite) -> list[str]:
    """Return the plug-ins of the tests, in order."""
    return [test.plugin for test in suite.tests]


# --- the C++ framework's meaning --------------------------------------------------------------------------------------


def test_tests_run_in_file_order():
    """Tests are in the order of the file."""
    assert plugins(sound("<test> C </test><test>A</test><test>\n B\n</test>")) == ["C", "A", "B"]


def test_element_names_are_compared_without_case():
    """Names of elements are read in any case."""
    assert plugins(load('<SUITE name="S"><Test>A</Test></SUITE>').suite) == ["A"]


def test_attribute_names_are_compared_with_case():
    """An attribute in the wrong case is a problem with a hint."""
    loaded = load('<suite name="S"><test PARAM="x">A</test></suite>')
    assert loaded.suite.tests[0].param == ""
    assert "<test> has no attribute 'PARAM'" in loaded.diagnostics[0].text
    assert loaded.diagnostics[0].hint == "did you mean 'param'?"


def test_white_space_in_text_is_condensed():
    """White space in a text is condensed to single blanks."""
    assert sound("<description>\n two\tprobes\n  here </description>").description == "two probes here"


def test_an_environment_is_given_to_the_tests_that_follow():
    """An environment applies to the tests after it, until the next one."""
    body = "<environment>a</environment><test>A</test><environment/><test>B</test>"
    body += "<environment>c</environment><test>C</test>"
    loaded = load(f'<suite name="S">{body}</suite>')
    assert [test.environment for test in loaded.suite.tests] == ["a", "", "c"]
    assert loaded.suite.environment == "c"


def test_a_test_before_the_environment_is_a_trap_and_is_pointed_at():
    """An environment after a test is a warning, as it was probably meant for all."""
    loaded = load('<suite name="S"><test>A</test>\n<environment>e</environment><test>B</test></suite>')
    assert [test.environment for test in loaded.suite.tests] == ["", "e"]
    (warning,) = loaded.diagnostics
    assert "too late for 1 test above it" in warning.text
    assert warning.line == 2
    assert loaded.errors == ()


def test_a_test_with_its_own_environment_is_no_trap():
    """A test with an environment of its own before the suite's is no warning."""
    suite = sound("<test>A<environment>own</environment></test><environment>e</environment><test>B</test>")
    assert [test.environment for test in suite.tests] == ["own", "e"]


def test_repetition_counts_additional_runs():
    """``repetition`` is the number of additional runs."""
    assert sound('<test repetition="4">A</test>').tests[0].repetition == 4


def test_a_comment_in_front_of_the_text_does_not_lose_the_test():
    """Comments within a test do not change its text."""
    assert plugins(sound("<test><!-- which --> A <!-- and --> B</test>")) == ["A B"]


def test_dashes_in_comments_are_forgiven_with_a_warning():
    """Double dashes in comments are a warning, and later places stay right."""
    loaded = load('<suite name="S">\n<!-- --from x.ini --->\n<!----><!-- é -- --><test x="">A</test></suite>')
    assert plugins(loaded.suite) == ["A"]
    comment, attribute = loaded.diagnostics
    assert "this comment (and 1 more) contains '--'" in comment.text
    assert (comment.line, comment.column) == (2, 1)
    assert (attribute.line, attribute.column) == (3, 27)


def test_a_suite_without_a_name_is_unknown():
    """A suite without a name is called unknown, with a warning."""
    loaded = load("<suite><test>A</test></suite>")
    assert (loaded.suite.name, loaded.suite.tests[0].id) == ("unknown", "unknown/A")
    assert [one.severity for one in loaded.diagnostics] == [Severity.WARNING]


def test_a_suite_without_tests_is_a_suite():
    """A suite without tests loads."""
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
    """A test is named by its name, or by plug-in and parameter file."""
    test = sound(element).tests[0]
    assert (name, test_id) == (test.name, test.id)


def test_equal_names_are_numbered_in_file_order():
    """Equal tests are numbered in the order of the file."""
    suite = sound("<test>A</test><test>B</test><test>A</test><test>A</test>")
    assert [test.id for test in suite.tests] == ["s/A", "s/B", "s/A+2", "s/A+3"]


def test_a_faulty_test_keeps_its_number():
    """A faulty test keeps its number, so that fixing it renames no other test."""
    loaded = load('<suite name="S"><test retries="x">A</test><test>A</test></suite>')
    assert [test.id for test in loaded.suite.tests] == ["s/A+2"]


# --- loops and variables ----------------------------------------------------------------------------------------------


def test_loops_in_loops_give_every_combination():
    """Nested loops give every combination; the inner variable changes first."""
    suite = sound(
        '<for name="part" in="left_arm right_arm">'
        '<for name="v" in="1 2"><test param="--p ${part} ${v}">J</test></for></for>',
    )
    assert [f"--p {part} {v}" for part in ("left_arm", "right_arm") for v in "12"] == [t.param for t in suite.tests]
    assert suite.tests[0].name == "J [left_arm 1]"


def test_loop_variables_reach_every_attribute_and_text():
    """Loop variables are replaced in every attribute and text."""
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
    """Values of a loop are separated by blanks outside of quotes."""
    suite = sound("""<for name="v" in="'a b' c,d"><test>T</test></for>""")
    assert [test.name for test in suite.tests] == ["T [a b]", "T [c,d]"]


def test_an_inner_loop_may_use_the_outer_variable():
    """The values of an inner loop may have the outer variable."""
    suite = sound('<for name="a" in="x y"><for name="b" in="${a}1 ${a}2"><test name="${b}">T</test></for></for>')
    assert [test.name for test in suite.tests] == ["x1", "x2", "y1", "y2"]


def test_unknown_variables_stay_for_the_test_to_resolve():
    """Unknown variables stay in the text, for the test to resolve."""
    suite = sound('<environment>${robotname}</environment><test param="${robotname} ${v}">T</test>', v="5")
    assert (suite.tests[0].param, suite.environment) == ("${robotname} 5", "${robotname}")


def test_values_are_not_looked_into_again():
    """Values of variables are not substituted again."""
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
    """An invalid loop is an error."""
    (problem,) = problems(loop)
    assert "error: " in problem
    assert message in problem


# --- defaults and attributes ------------------------------------------------------------------------------------------


def test_a_full_file_is_understood_to_the_last_attribute():
    """A file with all elements is read: defaults, overrides, fixtures, includes."""
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
    """Every attribute of a fixture is read, with its own parameters only."""
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
    """Parameters of the suite come before those of the test, so that the test's count."""
    suite = sound('<test>A<parameter name="v">2</parameter></test><parameter name="v">1</parameter>')
    assert suite.tests[0].parameters == (("v", "1"), ("v", "2"))


def test_an_included_file_keeps_its_defaults_for_its_own_tests():
    """Defaults of an included file apply to its own tests; tags add up."""
    suite = load_suite(DATA / "arms.xml").suite
    left, right = (entry_of(suite, f"arms-and-cameras/JointLimits[{side}_leg]") for side in ("left", "right"))
    assert (left.timeouts.run, right.timeouts.run, suite.tests[1].timeouts.run) == (99, 7, None)
    assert (left.retries, suite.tests[1].retries) == (0, 1)
    assert left.tags == ("legs", "nightly", "safe")
    assert (suite.environment, "--robotname icub") == (left.environment, right.environment)
    assert Path(left.location.file) == DATA / "parts" / "legs.xml"


@pytest.mark.parametrize(
    ("attribute", "message"),
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
def test_a_bad_value_is_an_error_at_its_place_and_keeps_the_test_out(attribute: str, message: str):
    """An invalid value is an error with place and valid values, and omits the test."""
    loaded = load(f'<suite name="S">\n  <test {attribute}>A</test><test>B</test></suite>')
    assert plugins(loaded.suite) == ["B"]
    (error,) = loaded.errors
    assert message in str(error)
    assert (error.line, error.column) == (2, 9)


def test_all_problems_are_reported_in_one_go():
    """All problems are reported in order, with line and column."""
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
    ("body", "message"),
    [
        ("<tst>A</tst>", "<suite> has no element <tst>; it is not read (did you mean 'test'?)"),
        ('<test timeot="3">A</test>', "<test> has no attribute 'timeot'; it is not read (did you mean 'timeout'?)"),
        ("<group><test>A</test><test>B</test></group>", "no element <group>; it is not read, and with it 2 tests"),
        ("<description/><group/><group/>", "<suite> has no element <group>; it is not read"),
    ],
)
def test_an_unknown_name_is_an_error_with_a_hint_or_leniently_a_warning(body: str, message: str, lenient: bool):
    """An unknown element or attribute is an error with a hint, leniently a warning."""
    loaded = load_suite_bytes(f'<suite name="S">{body}</suite>'.encode(), "s.xml", lenient=lenient)
    assert message in str(loaded.diagnostics[0])
    assert len(loaded.errors) == (0 if lenient else len(loaded.diagnostics))


def test_what_editors_write_to_find_the_schema_is_no_problem():
    """Attributes of XML itself are no problem."""
    sound("", 'name="S" xmlns="urn:s" xmlns:xsi="urn:x" xsi:noNamespaceSchemaLocation="suite.xsd" xml:lang="en"')


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<suite name='T'/>", "use <include> instead"),
        ("<test>A<test>B</test></test>", "it may stand in <for> or <suite>"),
        ('<for name="a" in="b"><fixture>F</fixture></for>', "it may stand in <suite>"),
        ('<for name="a" in="b"><environment>F</environment></for>', "it may stand in <fixture> or <suite> or <test>"),
    ],
)
def test_a_known_element_at_the_wrong_place_is_an_error(body: str, message: str):
    """A known element at a wrong place is an error."""
    (problem,) = problems(body)
    assert "error: " in problem
    assert message in problem


def test_expected_failures_want_a_reason():
    """An expected failure without a reason is a problem, and a reason without one, too."""
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
    """Each fault has one message of its own."""
    (problem,) = problems(body)
    assert message in problem


def test_modules_to_preload_have_names():
    """An invalid module name in ``preload`` is a problem."""
    assert "'1x' is no name of a Python module" in problems("", 'name="S" preload="numpy 1x"')[0]


# --- properties -------------------------------------------------------------------------------------------------------

WORD = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"], exclude_characters="<>&\"'${}~"), min_size=1)


def escape(text: str) -> str:
    """Write a text with every character as a reference."""
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
    """Plug-ins, parameters, numbers and tags are loaded as written, in order, once per loop value."""
    body = "".join(
        f'<test param="{escape(param)}" retries="{retries}" tags="{" ".join(tags)}">{escape(plugin)}</test>'
        for plugin, param, retries, tags in tests
    )
    suite = sound(f'<for name="part" in="{" ".join(values)}">{body}</for>')
    expected = [(plugin, param, retries, tuple(sorted(set(tags)))) for plugin, param, retries, tags in tests]
    assert expected * len(values) == [(t.plugin, t.param, t.retries, t.tags) for t in suite.tests]
    assert len({test.id for test in suite.tests}) == len(suite.tests)
