"""The warnings of the plug-in, for people who filter them by class."""

from __future__ import annotations

import pytest


class RobotTestWarning(pytest.PytestWarning):
    """A notice about robot tests that is not a failure."""


class SuiteFileWarning(RobotTestWarning):
    """A statement of a suite file that is probably a mistake."""


class FlakyTestWarning(RobotTestWarning):
    """A test passed, but not at the first attempt."""


class FixtureWarning(RobotTestWarning):
    """A fixture collapsed, and was started again."""
