"""The page on the suites of icub-tests is what the command says of files in their form, and of the originals."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest
from upstream_suites import Outcome, Row, as_markdown, read_suites, with_table

from harness import write_files

ROOT = Path(__file__).parents[2]
FACTS = ROOT / "tests" / "data" / "upstream" / "suites"
ORIGINALS = os.environ.get("RTF_UPSTREAM_SUITES", "")


def rows_of(folder: Path, tmp_path: Path) -> list[Row]:
    """Read a folder of suites where the user has no files and programs of his own."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("YARP_CONFIG_HOME", "YARP_DATA_HOME", "YARP_CONFIG_DIRS", "YARP_DATA_DIRS"):
            patch.setenv(name, str(tmp_path / "nothing"))
        patch.delenv("YARP_ROBOT_NAME", raising=False)
        patch.chdir(tmp_path)
        return read_suites(folder)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    """What becomes of the tests of our files."""
    return rows_of(FACTS, tmp_path_factory.mktemp("facts"))


def test_the_table_is_current(rows: list[Row]):
    """It is what tools/upstream_suites.py says of tests/data/upstream/suites; it writes the page, too."""
    page = (ROOT / "docs" / "upstream-suites.md").read_text(encoding="utf-8")
    assert with_table(page, as_markdown(rows)) == page


def test_every_test_has_one_of_three_outcomes(rows: list[Row]):
    """All 144 tests of 29 suites are there; 27 cannot pass, one of them for an open quote in its file."""
    assert len({row.suite for row in rows}) == 29
    assert Counter(row.outcome for row in rows) == {Outcome.RUNS: 97, Outcome.BLOCKED: 20, Outcome.REFUSED: 27}
    assert all(row.reason for row in rows if row.outcome is not Outcome.RUNS)
    refused = [row.reason for row in rows if row.outcome is Outcome.REFUSED]
    assert all(reason.partition(":")[0].endswith((".xml", ".ini")) for reason in refused)
    assert all(reason.split(":")[1].isdigit() for reason in refused)


def test_what_is_missing_is_named(tmp_path: Path):
    """A program, a node and a test that are not there are named with their places, as are rates that contradict."""
    application = "<application><name>a</name><module><name>{}</name>{}</module></application>"
    camera = "portname /cam\nmeasure_time 2\nexpected_frequency {}\ntolerance 10\n"
    files = {
        "suites/device.xml": '<suite><fixture param="--fixture device.xml">yarpmanager</fixture>'
        '<test param="--portname /cam">CameraTest</test></suite>',
        "suites/far.xml": '<suite><fixture param="--fixture far.xml">yarpmanager</fixture>'
        '<test param="--portname /cam">CameraTest</test></suite>',
        "suites/none.xml": "<suite>\n<test>NoSuchTest</test>\n</suite>",
        "suites/two.xml": '<suite><test param="--from slow.ini">CameraTest</test>'
        '<test param="--from fast.ini">CameraTest</test></suite>',
        "suites/fixtures/device.xml": application.format("yarpdev", ""),
        "suites/fixtures/far.xml": application.format("iCub_SIM", "<node>/pc104</node>"),
        "suites/slow.ini": camera.format(30),
        "suites/fast.ini": camera.format(60),
    }
    write_files(tmp_path, files)
    found = {(row.suite, row.outcome): row.reason for row in rows_of(tmp_path / "suites", tmp_path)}
    assert found["device.xml", Outcome.BLOCKED].startswith("yarpdev is not there: devices are started from")
    assert found["far.xml", Outcome.BLOCKED] == "fixtures/far.xml:1:28: iCub_SIM needs the node /pc104"
    assert found["none.xml", Outcome.REFUSED] == "none.xml:2:1: no test plug-in 'NoSuchTest'"
    wanted = "slow.ini:3: 25 to 35 Hz exclude the 55 to 65 Hz of /cam, as fast.ini:3 says"
    assert found["two.xml", Outcome.REFUSED] == wanted
    assert found["two.xml", Outcome.RUNS] == ""


@pytest.mark.skipif(not ORIGINALS, reason="RTF_UPSTREAM_SUITES names no folder of icub-tests")
def test_the_originals_are_like_our_files(rows: list[Row], tmp_path: Path):
    """The suites of a checkout of icub-tests have the same tests with the same outcomes."""
    originals = rows_of(Path(ORIGINALS).resolve(), tmp_path)
    wanted = [(row.suite, row.test, row.outcome) for row in rows]
    assert sorted((row.suite, row.test, row.outcome) for row in originals) == sorted(wanted)
