"""A test that fails now and then: here, exactly the first time in a run."""

import os
from pathlib import Path

from rtf.testing import TestCase


class Flaky(TestCase):
    """Passes when it is tried again; the verdict says so."""

    def run(self):
        """Fail unless somebody was here before."""
        mark = Path(os.environ["RTF_RUN_FOLDER"]) / "flaky.mark"
        tried = mark.exists()
        mark.touch()
        self.check(tried, "somebody was here before")
