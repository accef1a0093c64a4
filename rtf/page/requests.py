"""Requests of all pages that change something: they need the token, and are limited in size and time."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from starlette.requests import ClientDisconnect

from rtf.page.responses import error_response

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from rtf.page.access import Access

#: Seconds for a client to send its request.
BODY_TIME = 10.0


async def read_body(request: Request, access: Access, most: int) -> bytes | Response:
    """Return the JSON of a request with the token, of at most so many bytes; the response that refuses any other."""
    if not access.may_control(request.headers.get("authorization", "")):
        refusal = error_response(401, "the token is missing or wrong; open the address that was printed")
        refusal.headers["www-authenticate"] = "Bearer"
        return refusal
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        return error_response(415, "want application/json")
    try:
        async with asyncio.timeout(BODY_TIME):
            return await _body(request, most)
    except TimeoutError:
        return error_response(408, "the request is incomplete")
    except OverflowError:
        return error_response(413, f"the request is larger than {most >> 10} KiB")
    except ClientDisconnect:
        return error_response(400, "the request is incomplete")


async def _body(request: Request, most: int) -> bytes:
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > most:
            raise OverflowError
    return body
