"""The picture of the control modes says what the tables say."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import control_mode_picture as picture
import pytest

from rtf.robot.control_modes import FORCED, REQUESTS, STATES, Answer, ControlMode, answer

STORED = Path(__file__).parents[2] / "docs" / "images" / "control-modes.svg"
SVG = "{http://www.w3.org/2000/svg}"


def texts() -> list[str]:
    """What is written in the picture."""
    return [element.text or "" for element in ET.fromstring(picture.draw()).iter(f"{SVG}text")]


def test_the_documentation_shows_this_one():
    """``python tools/control_mode_picture.py docs/images/control-modes.svg`` fixes it."""
    assert STORED.read_text(encoding="utf-8") == picture.draw()


def test_every_state_stands_in_one_box():
    """With the word that travels."""
    written = texts()
    for state in STATES:
        assert sum(text.endswith(f" [{state.word}]") and "," not in text and ":" not in text for text in written) == 1


def test_every_arrow_of_the_tables_is_drawn_and_no_other():
    """Those on request and those that a board makes by itself."""
    drawn = [
        element.get("class") for element in ET.fromstring(picture.draw()).iter(f"{SVG}path") if element.get("class")
    ]
    assert drawn.count("arrow asked") == len(picture.requested()) == len(picture._ON_REQUEST)
    assert len(drawn) - drawn.count("arrow asked") == len(picture.forced()) == len(picture._BY_ITSELF)
    assert set(picture.requested()["fault", "idle"]) == {ControlMode.FORCE_IDLE}


@pytest.mark.parametrize("state", STATES, ids=lambda state: state.word)
def test_what_is_ignored_is_listed(state: ControlMode):
    """Each request that a board ignores in a state stands in the sentence about it."""
    said = picture.what_is_taken(state)
    ignored = [request for request in REQUESTS if answer(state, request)[0] is not Answer.TAKEN]
    if len(ignored) == len(REQUESTS):
        assert said == "every request is ignored"
    else:
        assert all(f"[{request.word}]" in said.rpartition("ignored")[2] for request in ignored)


def test_what_a_board_does_by_itself_is_shown():
    """Each reason stands in the picture."""
    written = texts()
    assert all(any(why in text for text in written) for _, why, _ in FORCED)


def test_words_are_escaped(monkeypatch: pytest.MonkeyPatch):
    """Whatever the tables may say one day, it is a picture."""
    monkeypatch.setattr(picture, "FORCED", ((None, '<&">', ControlMode.HARDWARE_FAULT),))
    assert any('<&">' in text for text in texts())


def test_it_is_written_by_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """To the file that is named."""
    monkeypatch.setattr(sys, "argv", ["control_mode_picture", str(tmp_path / "picture.svg")])
    picture.main()
    assert (tmp_path / "picture.svg").read_text(encoding="utf-8") == picture.draw()
