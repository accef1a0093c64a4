"""A test that needs the server, which dies during the first attempt."""

import os
import socket
from pathlib import Path

from rtf.testing import TestCase


class AskServer(TestCase):
    """Talks to the server of the fixture."""

    def run(self):
        """Send a request; the first generation of the server dies of it."""
        port = int((Path(os.environ["RTF_RUN_FOLDER"]) / "server.port").read_text())
        with socket.create_connection(("127.0.0.1", port), timeout=5) as connection:
            connection.sendall(b"how are you?\n")
            answer = connection.makefile().readline().strip()
        self.check_equal(answer, "fine", "the server's answer")
