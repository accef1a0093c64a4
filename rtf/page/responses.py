"""Responses of all pages: a file of the page, a text, a value as JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from starlette.responses import Response

if TYPE_CHECKING:
    from rtf.page.assets import Asset


def asset_response(found: Asset | None) -> Response:
    """Return a file of the page, or that there is none."""
    if found is None:
        return text_response(404, "there is no such page")
    return Response(found.content, media_type=found.media_type)


def text_response(status: int, text: str) -> Response:
    """Return a line of text; what cannot be encoded is written out."""
    return Response(f"{text}\n".encode(errors="backslashreplace"), status, media_type="text/plain; charset=utf-8")


def json_response(status: int, value: object) -> Response:
    """Return a value as JSON."""
    return Response(json.dumps(value).encode(), status, media_type="application/json")


def error_response(status: int, text: str) -> Response:
    """Return why a request is refused, as JSON."""
    return json_response(status, {"error": text})
