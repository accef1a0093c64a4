"""Run one test in a process that can be stopped as a worker can: stoppable.py LANGUAGE PATH FOLDER EVENTS [PARAM]."""

import signal
import sys
from pathlib import Path

from rtf.testing.events import to_line
from rtf.testing.isolation.messages import Job, Use
from rtf.testing.plugins import PluginRef
from rtf.testing.session import Session
from rtf.testing.isolation.worker import run_test

language, path, folder, events, *param = sys.argv[1:]
job = Job(
    kind="test",
    id="suite/test",
    name="test",
    plugin=PluginRef("test", Path(path).name, path, language),
    folder=folder,
    run_folder=folder,
    use=Use(param=" ".join(param)),
)
with open(events, "wb", buffering=0) as stream:
    session = Session("suite/test", lambda event: stream.write(to_line(event) if hasattr(event, "seq") else b""), folder=Path(folder), run_folder=Path(folder))
    signal.signal(signal.SIGINT, lambda *_: session.stop("stopped"))
    outcome = run_test(job, session)
# The most memory in kB; ru_maxrss would be that of whoever started this.
peak = next(line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
print(f"{outcome.outcome} {outcome.stopped or '-'} {peak}", file=sys.stderr)
