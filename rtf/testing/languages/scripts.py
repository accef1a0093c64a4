"""Tests that are not classes of RTF: programs, and scripts for the C++ framework in Lua or Python.

They declare no parameters and take the suite's ``param`` string as it stands. A ``<parameter>`` element or a ``--set``
becomes ``--key value`` behind it, where programs that read their arguments from left to right let the last one win.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.resources.arguments import split_arguments
from rtf.testing.case import TestCase
from rtf.testing.secret_values import MASK, is_secret, masked_text
from rtf.testing.verdict import Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rtf.testing.session import Session

    Place = tuple[str, int]

#: Characters of a condition that are shown in a title.
_SHOWN = 200


class RawParameters(TestCase):
    """Base of the tests whose parameter string is not interpreted."""

    #: The parameter string with everything that was added to it.
    parameter: str = ""
    #: The values given by ``<parameter>`` and ``--set`` alone, the latter winning.
    added: dict[str, str]
    #: The words of the parameter string; an added value is one word whatever is in it.
    words: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.added = {}

    def resolve_parameters(
        self,
        *,
        param: str,
        parameters: Sequence[tuple[str, str]] = (),
        overrides: Sequence[tuple[str, str]] = (),
        environment: str = "",
        place: str = "",
        folder: str = "",
    ) -> list[dict[str, str]]:
        """Keep the string; nothing in it is interpreted, not even ``--from``. See the base class for the arguments."""
        del environment, folder
        self.added = dict(parameters) | dict(overrides)
        self.parameter = " ".join([*([param] if param else []), *(_option(*pair) for pair in self.added.items())])
        words = split_arguments(param)
        for key, value in self.added.items():
            words += [f"--{key}", *([value] if value else [])]
        self.words = tuple(words)
        rows = [_row("param", masked_text(param), "param", place)] if param else []
        for key, value in self.added.items():
            shown = MASK if is_secret(key) else value
            rows.append(_row(key, shown, "--set") if key in dict(overrides) else _row(key, shown, "<parameter>", place))
        return rows


def _row(name: str, value: str, source: str, place: str = "") -> dict[str, str]:
    return {"name": name, "value": value, "unit": "", "source": f"{source} of {place}" if place else source}


def _option(key: str, value: str) -> str:
    if not value:
        return f"--{key}"
    return f'--{key} "{value}"' if " " in value and '"' not in value else f"--{key} {value}"


class ScriptTest(RawParameters):
    """Base of scripts for the C++ framework: what its functions do, called with the line of the script."""

    @property
    def session(self) -> Session:
        """The session that receives the script's calls."""
        return self._session

    def report_at(self, place: Place, text: str) -> None:
        """Report a message."""
        self.session.message(Severity.INFO, "reports", text, place)

    def check_at(self, place: Place, holds: object, text: str) -> None:
        """Report the text if the condition holds, as a failure if it does not."""
        self.session.check(holds, text, place)

    def fail_unless(self, place: Place, holds: object, shown: str, text: str) -> None:
        """Report a failure if the condition, as ``shown``, does not hold.

        This is the ``testFailIf`` of the C++ framework, whose name says the opposite.
        """
        self.session.check(holds, text, place, title=f"checking ({shown[:_SHOWN]})", quiet=True)
