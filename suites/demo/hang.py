"""A test that never returns."""

import threading

from rtf.testing import TestCase


class Hang(TestCase):
    """Waits for an event that is never set."""

    def run(self):
        """Hang."""
        self.report("waiting for an event that is never set")
        threading.Event().wait()
