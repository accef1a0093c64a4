"""Random frames for the decoder, fewer than ``run_can_frames`` has, and frames through a bus."""

from __future__ import annotations

import pytest

from .run_can_frames import fuzz, fuzz_driver, through_a_bus


@pytest.mark.fuzz
def test_random_frames_are_messages_or_are_refused():
    """Nothing but MessageError is raised, and a message has the same bytes again."""
    assert fuzz(20_000, seed=0) > 500


@pytest.mark.fuzz
def test_the_driver_survives_random_frames():
    """Its states stay finite and in their ranges, and its modes are known ones."""
    assert fuzz_driver(5_000, seed=0) == 50


def test_no_frame_is_lost_on_a_bus():
    """All frames that one end sends without a pause arrive at the other."""
    assert through_a_bus(3000) > 0
