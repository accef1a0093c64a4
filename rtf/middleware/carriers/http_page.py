"""The page of a port, and of a name server: untrusted text, escaped, in a document that runs no scripts."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from jinja2 import Template

    from rtf.middleware.carriers.base import CarrierPort

_HERE = files("rtf.middleware.carriers")
_STYLE = _HERE.joinpath("http_page.css").read_text("utf-8")
_STYLE_HASH = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
#: What a page may do: show its own style and its own pictures, and send its own form.
POLICY = (
    f"default-src 'none'; style-src 'sha256-{_STYLE_HASH}'; img-src 'self' data:; form-action 'self'; "
    "base-uri 'none'; frame-ancestors 'none'"
)


class Exchange(NamedTuple):
    """A request that was sent by the form, and its reply."""

    request: str
    reply: str


def of_port(port: CarrierPort, token: str, exchange: Exchange | None = None) -> str:
    """Return the page of a port. ``token`` is the secret of its form."""
    return _template().render(
        style=_STYLE,
        title=port.name,
        address=f"{port.contact.host}:{port.contact.port}",
        page=port.page(),
        token=token,
        exchange=exchange,
    )


def of_problem(title: str, why: str) -> str:
    """Return the page that says why a request was refused."""
    return _template().render(style=_STYLE, title=title, problem=why)


@cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined  # imported here: only a port that is browsed needs it

    # Undefined values are errors, but for those that are tested for.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_HERE.joinpath("http_page.html.j2").read_text("utf-8"))
