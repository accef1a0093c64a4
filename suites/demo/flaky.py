"""A flaky test: it fails exactly the first time in a run."""

import os
from pathlib import Path

from rtf.testing import TestCase


class Flaky(TestCase):
    """Passes when it is retried; its verdict is flaky."""

    def run(self):
        """Fail at the first attempt."""
        mark = Path(os.environ["RTF_RUN_FOLDER"]) / "flaky.mark"
        tried = mark.exists()
        mark.touch()
        self.check(tried, "this is not the first attempt")
