"""A test that takes its process with it."""

import ctypes

from rtf.testing import TestCase


class Crash(TestCase):
    """Reads where nothing is: a segmentation fault."""

    def run(self):
        """Crash."""
        self.report("about to read address 0")
        ctypes.string_at(0)
