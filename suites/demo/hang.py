"""A test that never comes back."""

import threading

from rtf.testing import TestCase


class Hang(TestCase):
    """Waits for an event that nobody sets."""

    def run(self):
        """Hang."""
        self.report("waiting for an event that nobody sets")
        threading.Event().wait()
