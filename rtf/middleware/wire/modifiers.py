"""Modifiers of a connection: ``tcp+recv.priority+tc.2`` is tcp with two modifiers.

``recv.NAME`` names what the receiving port does with the messages, ``send.NAME`` what the sending one does; all others
are settings of these. In a handshake they follow the name of the sender, as a bottle: ``/a (recv priority) (tc 2)``. A
point separates a setting from its value, so a value has none: decimal fractions cannot be written.
"""

from __future__ import annotations

from rtf.bottle import Bottle, BottleError, as_string, to_string
from rtf.middleware.errors import ProtocolError

#: The names of carriers that contain a plus sign.
_WITH_PLUS = ("unix_stream+ack",)
_TO_BOTTLE = str.maketrans({"+": ") (", ".": " "})


def split(carrier: str) -> tuple[str, str]:
    """Return the name of a carrier, and its modifiers as they are written in a handshake; empty if there are none."""
    name, _, rest = carrier.partition("+")
    for longer in _WITH_PLUS:
        if carrier == longer or carrier.startswith(f"{longer}+"):
            name, rest = longer, carrier[len(longer) + 1 :]
    return name, f"({rest.translate(_TO_BOTTLE)})" if rest else ""


def read(text: str) -> dict[str, Bottle]:
    """Return the values of each modifier in a handshake. A later one replaces an earlier one of the same name.

    Raises ProtocolError if the text is not a bottle.
    """
    try:
        groups = Bottle.parse(text, strict=True)
    except BottleError as error:
        raise ProtocolError(f"the modifiers {text!r} cannot be read: {error}") from None
    found = {}
    for group in groups:
        while isinstance(group, Bottle) and len(group) == 1 and isinstance(group[0], Bottle):
            group = group[0]  # noqa: PLW2901 - a list in the name of a carrier arrives as ((ex (/a -5)))
        values = group if isinstance(group, Bottle) else Bottle([group])
        if len(values):
            found[as_string(values[0]) or to_string(values[0])] = values.tail()
    return found


def join(name: str, modifiers: dict[str, Bottle]) -> str:
    """Return a carrier with modifiers as it is written by people: the inverse of ``split`` and ``read``."""
    parts = [name]
    for key, values in modifiers.items():
        if any(isinstance(value, Bottle) for value in values):
            parts.append(Bottle([Bottle([key, *values])]).to_text())
        elif key not in name.split("+"):  # YARP's programs send the ack of unix_stream+ack as a modifier, too
            parts.append(".".join([key, *map(to_string, values)]))
    return "+".join(parts)
