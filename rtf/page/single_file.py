"""The page as a single file: inline style and scripts, allowed by their hashes only, and a place for the data.

A page refers to its files by ``<link rel="stylesheet" href="…">``, ``<script src="…" defer></script>`` and
``<script type="module" src="…"></script>``; exactly these are replaced. A reference of any other form is an error,
because a page that is opened offline could not load it.
"""

from __future__ import annotations

import base64
import hashlib
import html
import re
import zlib
from typing import TYPE_CHECKING

from rtf.page.assets import INDEX, read_assets
from rtf.page.bundle import BundleError, join_modules

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import BinaryIO

_REFERENCE = re.compile(
    r'<link rel="stylesheet" href="(?P<style>[\w.-]+)">'
    r'|<script src="(?P<script>[\w.-]+)"(?: defer)?></script>'
    r'|<script type="module" src="(?P<module>[\w.-]+)"></script>'
)
#: References to files that were not replaced; ``data:`` URLs are part of the page.
_LEFT = re.compile(r"<(?:link|script|img|iframe|object|embed|source|base)\b[^>]*\b(?:href|src|data)=(?!\"data:)[^>]*>")
#: Texts that would end an inline element early, or keep it from ending.
_HOSTILE = re.compile(r"</(?:script|style)|<script|<!--", re.IGNORECASE)
_CHARSET = '<meta charset="utf-8">'
#: The data are put here: the page builds its own body.
_END = "</head>"


def page_in_pieces(sources: Mapping[str, str] | None = None, index: str = INDEX) -> tuple[bytes, bytes]:
    """Return the page ``index`` before the data and after them. Raises BundleError.

    ``sources`` are the texts of the page's files by name, by default the shipped ones.
    """
    if sources is None:
        sources = {name: asset.text for name, asset in read_assets().items()}
    return _Page(sources, index).pieces()


class _Page:
    """The page while its references are replaced; collects the hashes of the inline elements."""

    def __init__(self, sources: Mapping[str, str], index: str) -> None:
        self._sources = sources
        self._index = index
        self._hashes: dict[str, list[str]] = {"script": [], "style": []}

    def pieces(self) -> tuple[bytes, bytes]:
        index = self._source(self._index)
        self._refuse_other_references(index)
        text = _REFERENCE.sub(self._inline, index)
        for needed in (_CHARSET, _END):
            if index.count(needed) != 1:
                raise BundleError(
                    f"{self._index} must have {needed} exactly once, where the policy or the data are inserted"
                )
        # A policy applies to the elements after it.
        text = text.replace(_CHARSET, f"{_CHARSET}\n{self._policy()}", 1)
        head, _, tail = text.rpartition(_END)
        return head.encode(), (_END + tail).encode()

    def _source(self, name: str) -> str:
        if name not in self._sources:
            raise BundleError(f"{self._index}: there is no file {name}")
        return self._sources[name].replace("\r\n", "\n")

    def _refuse_other_references(self, index: str) -> None:
        left = _LEFT.search(_REFERENCE.sub("", index))
        if left is not None:
            raise BundleError(
                f"{self._index}: {left[0]} would be missing in a single file; "
                f"see {__name__} for the supported references"
            )

    def _inline(self, match: re.Match[str]) -> str:
        if match["style"]:
            return self._element("style", "", match["style"], self._source(match["style"]))
        if match["script"]:
            return self._element("script", "", match["script"], self._source(match["script"]))
        joined = join_modules({name: self._source(name) for name in self._sources}, match["module"])
        return self._element("script", ' type="module"', match["module"], joined)

    def _element(self, tag: str, attributes: str, name: str, text: str) -> str:
        hostile = _HOSTILE.search(text)
        if hostile is not None:
            raise BundleError(f"{name}: {hostile[0]} cannot be in a page that is a single file; split it")
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        self._hashes[tag].append(f"'sha256-{digest}'")
        return f"<{tag}{attributes}>{text}</{tag}>"

    def _policy(self) -> str:
        rules = {
            "default-src": "'none'",
            "script-src": " ".join(self._hashes["script"]) or "'none'",
            "style-src": " ".join(self._hashes["style"]) or "'none'",
            "img-src": "data: blob:",
            "base-uri": "'none'",
            "form-action": "'none'",
        }
        content = "; ".join(f"{name} {value}" for name, value in rules.items())
        return f'<meta http-equiv="Content-Security-Policy" content="{content}">'


def write_block(stream: BinaryIO, attributes: Mapping[str, str], pieces: Iterable[bytes]) -> None:
    """Write data into the page, as base64 of gzip, so that they cannot end their element."""
    named = "".join(f' {name}="{_attribute(value)}"' for name, value in attributes.items())
    # A lone surrogate, of a file name that is not valid text, cannot be in a page; the block is never requested.
    stream.write(f'<script type="application/x-rtf"{named}>'.encode(errors="replace"))
    packer = zlib.compressobj(wbits=31)  # 31: with the head and the sum of gzip
    rest = b""
    for piece in pieces:
        rest += packer.compress(piece)
        whole = len(rest) - len(rest) % 3  # base64 takes three bytes at a time
        if whole:
            stream.write(base64.b64encode(memoryview(rest)[:whole]))
            rest = rest[whole:]
    stream.write(base64.b64encode(rest + packer.flush()))
    stream.write(b"</script>\n")


def _attribute(value: str) -> str:
    return html.escape(value).replace("\r", "&#13;")  # otherwise parsers would read it as a line end
