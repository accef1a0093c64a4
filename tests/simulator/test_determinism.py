"""Two runs with the same seed and the same commands are the same to the last bit, in whatever process."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from .recorded_run import record

pytestmark = pytest.mark.skipif(
    not (find_spec("mujoco") and find_spec("icub_models")), reason="needs pip install 'rtf[sim]'"
)


def test_the_same_seed_gives_the_same_run():
    """All that all ports send, with noise and stamps, and the state at the end: twice here, once in another process."""
    first = record(7)
    assert record(7) == first
    words = [sys.executable, str(Path(__file__).with_name("recorded_run.py")), "7"]
    printed = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    digests, state, count = first
    assert printed.stdout.splitlines() == [
        *(f"{name} {digest}" for name, digest in sorted(digests.items())),
        f"state {state} {count}",
    ]
    # Each of the ports sent something, a hundred times a second, skin fifty times; only the two legs, which rest, say
    # the same.
    skin = sum("/skin/" in name for name in digests)
    assert skin == 4
    assert count >= 199 * (len(digests) - skin) + 99 * skin
    assert len(set(digests.values())) >= len(digests) - 1


def test_another_seed_gives_other_noise_and_the_same_motion():
    """Sensors of forces differ, joints do not: their encoders have no noise."""
    (one, state, _), (other, same_state, _) = record(1), record(2)
    different = {name for name in one if one[name] != other[name]}
    assert "/icubSim/left_arm/analog:o" in different
    assert "/icubSim/inertial" in different
    assert "/icubSim/left_arm/state:o" not in different
    assert state == same_state
