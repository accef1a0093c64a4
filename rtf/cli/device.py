"""The record of the device under test: ``--device``, ``--device-file`` and ``--device-ask``."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from rtf.cli.parser import UsageError, key_value

#: The keys that ``--device-ask`` asks for. A station may record any other key, too.
QUESTIONS = {
    "serial": "serial number",
    "part": "part number",
    "firmware": "firmware version",
    "operator": "operator",
    "batch": "batch",
}
_KEY = re.compile(r"[A-Za-z][\w.-]*", re.ASCII)


def add_device_options(group: argparse._ActionsContainer) -> None:
    """Add the options of the record of the device under test."""
    group.add_argument(
        "--device",
        metavar="KEY=VALUE",
        type=device_value,
        action="append",
        default=[],
        help=f"record of the device under test: {', '.join(QUESTIONS)}, or any other key",
    )
    group.add_argument("--device-file", metavar="TOML", help="read that record from a file of KEY = VALUE lines")
    group.add_argument("--device-ask", action="store_true", help="ask at the terminal for what is missing in it")


def device_value(text: str) -> tuple[str, str]:
    """Read ``KEY=VALUE`` of the record."""
    key, value = key_value(text)
    return _checked_key(key), _checked_value(key, value)


def device_record(options: argparse.Namespace) -> dict[str, str]:
    """Return the record of the device: from the file, then the options, then the operator. Raises UsageError."""
    record = _read(Path(options.device_file)) if options.device_file else {}
    record.update(options.device)
    return _asked(record) if options.device_ask else record


def _read(path: Path) -> dict[str, str]:
    import tomllib

    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"--device-file {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"--device-file {path}: {error}") from None
    record = {}
    for key, value in values.items():
        if isinstance(value, dict | list):
            raise UsageError(f"--device-file {path}: {key} is not a single value")
        try:
            record[_checked_key(key)] = _checked_value(key, str(value))
        except argparse.ArgumentTypeError as error:
            raise UsageError(f"--device-file {path}: {error}") from None
    return record


def _asked(record: dict[str, str]) -> dict[str, str]:
    if not sys.stdin.isatty():
        raise UsageError("--device-ask needs a terminal; use --device or --device-file")
    for key, question in QUESTIONS.items():
        if key not in record:
            try:
                answer = input(f"{question} of the device (Enter: not recorded)? ").strip()
            except EOFError:
                raise UsageError("--device-ask: the terminal was closed before all questions were answered") from None
            if answer:
                record[key] = answer
    return record


def _checked_key(key: str) -> str:
    if not _KEY.fullmatch(key):
        raise argparse.ArgumentTypeError(f"{key!r} is no key; write a letter, then letters, digits, '_', '.' or '-'")
    return key


def _checked_value(key: str, value: str) -> str:
    if not value.strip() or not value.isprintable():
        raise argparse.ArgumentTypeError(f"{key}: the value must be printable text, not {value!r}")
    return value.strip()
