"""The page of CAN messages is that of the table."""

from __future__ import annotations

from pathlib import Path

from rtf.robot.devices.can.message_page import message_page


def test_the_page_is_up_to_date():
    """``docs/can-messages.md`` is what ``rtf can messages`` prints."""
    page = Path(__file__).parents[2] / "docs" / "can-messages.md"
    assert page.read_text(encoding="utf-8") == message_page()
