"""``testrunner page``: the page of a run from its folder, served until Ctrl-C. Unlike the live page it stops no run."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.cli.parser import Parser, add_place_options
from rtf.testing.reporting import ReportError
from rtf.testing.verdict import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence


def page(words: Sequence[str]) -> ExitCode:
    """Serve the page of a run that is over, or that another process is carrying out."""
    parser = Parser(
        prog="testrunner page",
        description="Serve the page of a run from its folder, also of one that still goes on, until Ctrl-C.",
    )
    parser.add_argument("run", metavar="RUN", help="the folder of a run, such as rtf-runs/latest, or its journal")
    parser.add_argument("--compare", metavar="RUN", help="show an earlier run beside this one")
    parser.add_argument(
        "--history", metavar="FILE", nargs="?", const="", help="show trends from this file (default: the user's own)"
    )
    add_place_options(parser)
    options = parser.parse_args(words)

    from rtf.page.compare import journal_of
    from rtf.page.server_process import listen
    from rtf.page.settings import Settings

    folder = journal_of(Path(options.run)).resolve().parent
    compare = None if options.compare is None else str(journal_of(Path(options.compare)).resolve())
    listener = listen(options.web_host, options.web_port)
    settings = Settings(
        run_folder=str(folder),
        host=options.web_host,
        port=listener.getsockname()[1],
        compare=compare,
        history=options.history,
    )
    try:
        from rtf.page.server import serve_folder
    except ImportError as error:
        raise ReportError(f"the web page needs {error.name}: pip install {error.name}") from None
    print(f"web page: {settings.address}  (Ctrl-C ends it)", file=sys.stderr, flush=True)
    asyncio.run(serve_folder(settings, listener))
    return ExitCode.PASSED
