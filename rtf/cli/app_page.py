"""``rtf app page``: applications in a browser, where they are run, watched and built."""

from __future__ import annotations

import secrets
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from rtf.cli.app import GRACE, add_run_options, clean_up, make_manager, session_path
from rtf.cli.parser import add_place_options, key_value, make_parser
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rtf.applications.events import Say
    from rtf.applications.manager import Manager
    from rtf.applications.session import Session
    from rtf.applications.xml.model import Application

_TOKEN_BYTES = 16
_EMPTY = "<application>\n    <name>{}</name>\n</application>\n"


def page(words: Sequence[str]) -> int:
    """Serve the page of applications until Ctrl-C, which stops what it has started."""
    from rtf.applications.run.keeper import fork_server
    from rtf.cli.network.terminal import run_to_its_end

    parser = make_parser(
        "app page",
        "Run, watch and build applications in a browser, until Ctrl-C. What the page has started is stopped then.",
        "rtf app page lab.xml\nrtf app page lab.xml robot.xml --web-port 0\nrtf app page new.xml --new",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="applications: files, or names that YARP finds")
    parser.add_argument(
        "--var", action="append", type=key_value, default=[], metavar="NAME=VALUE", help="a variable, over the files'"
    )
    parser.add_argument("--new", action="store_true", help="begin with an empty application where there is no file")
    add_run_options(parser)
    add_place_options(parser)
    options = parser.parse_args(words)
    code = fork_server(GRACE)
    if code is not None:
        return run_to_its_end("rtf app page", lambda _: _clean_up(options, code), words)
    return run_to_its_end("rtf app page", lambda _: _serve(options), words)


def _paths(options: argparse.Namespace) -> list[Path]:
    """Return the files. Raises ApplicationError for one that is not there."""
    from rtf.applications.errors import ApplicationError
    from rtf.applications.xml.reader import find_application

    paths = []
    for word in options.files:
        path = Path(word)
        if not path.exists():
            path = find_application(word, Path.cwd()) or path
        if not path.exists():
            if not options.new:
                raise ApplicationError(f"there is no application {word}; --new begins an empty one")
            try:
                path.write_text(_EMPTY.format(escape(path.stem)), encoding="utf-8")
            except OSError as error:
                raise ApplicationError(f"{path} cannot be written: {error.strerror}") from None
        paths.append(path)
    return paths


def _serve(options: argparse.Namespace) -> int:
    from rtf.applications.page.control import ControlledApplication
    from rtf.cli.network.terminal import Bell, say
    from rtf.testing.reporting import ReportError

    try:
        from rtf.applications.page.web import serve_applications
    except ImportError as error:
        raise ReportError(f"the web page needs {error.name}: pip install {error.name}") from None
    factory = _Factory(options)
    with ExitStack() as stack:
        controlled = [
            stack.enter_context(closing(ControlledApplication(path, dict(options.var), factory)))
            for path in _paths(options)
        ]
        token = secrets.token_urlsafe(_TOKEN_BYTES)
        address = stack.enter_context(serve_applications(controlled, options.web_host, options.web_port, token))
        say(f"web page: {address}  (Ctrl-C stops what it has started, and ends it)")
        with suppress(KeyboardInterrupt):
            Bell().wait()
    return ExitCode.PASSED


def _clean_up(options: argparse.Namespace, code: int) -> int:
    """Stop what a killed page has left on nodes. In its parent process, which has ended what was on this machine."""
    from rtf.applications.xml.reader import read_application

    for path in _paths(options):
        loaded = read_application(path, dict(options.var))
        if not loaded.has_errors:
            clean_up(loaded.application, code)
    return code


class _Factory:
    """Makes sessions and managers by the options of the command line."""

    def __init__(self, options: argparse.Namespace) -> None:
        from rtf.cli.network.options import make_network

        self._options = options
        self.network = make_network()

    def session(self, application: Application) -> Session:
        from rtf.applications.session import Session

        return Session(session_path(application))

    def holder(self, application: Application) -> int:
        from rtf.applications.session import holder

        return holder(session_path(application))

    def manager(self, application: Application, said: Say, *, attached: bool = False) -> Manager:
        log, patience = self._options.log, self._options.timeout
        return make_manager(application, said, log=log, patience=patience, attached=attached)
