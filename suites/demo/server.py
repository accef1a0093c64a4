"""The program of the demo's fixture: a server whose first generation crashes when it is asked anything."""

import os
import socketserver
import sys
from pathlib import Path

FOLDER = Path(os.environ["RTF_RUN_FOLDER"])
MARK = FOLDER / "server.crashed"


class Handler(socketserver.StreamRequestHandler):
    """One question, one answer."""

    def handle(self):
        """Answer, or die once."""
        question = self.rfile.readline().decode().strip()
        print(f"asked: {question}", flush=True)
        if not MARK.exists():
            MARK.touch()
            print("cannot bear it", file=sys.stderr, flush=True)
            os.abort()
        self.wfile.write(b"fine\n")


def main():
    """Serve on a free port of this machine, and say which."""
    with socketserver.TCPServer(("127.0.0.1", 0), Handler) as server:
        port = server.server_address[1]
        (FOLDER / "server.port").write_text(str(port))
        print(f"listening on port {port}", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()
