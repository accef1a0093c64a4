"""Editors: a message that two programs share over ports, field by field, as YARP's generated editors do."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rtf.bottle import Bottle, BottleError, Vocab
from rtf.errors import did_you_mean
from rtf.idl.types import Message
from rtf.middleware.types.record import FAILED, OK, Record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.bottle import Value
    from rtf.idl.types import Field

M = TypeVar("M", bound=Message)
_HELP = "send: 'help' or 'patch (param1 val1) (param2 val2)'"


class Editor(Generic[M]):
    """Edits ``message`` here and from afar. All methods may be called from any thread.

    ``send`` is called with a message ``patch`` after each change that is made here, such as ``port.write``.
    :meth:`answer` takes what others send: it is the handler of an RPC server. ``changed`` is called with the name of a
    field that another program has set, and its former value.
    """

    def __init__(
        self,
        message: M,
        send: Callable[[Record], object] | None = None,
        changed: Callable[[str, object], None] | None = None,
    ) -> None:
        self.message = message
        self._send = send
        self._changed = changed
        self._fields = {field.name: field for field in message.FIELDS}
        self._lock = threading.RLock()
        self._depth = 0
        self._dirty: dict[str, Field] = {}

    # Here -------------------------------------------------------------------------------------------------------------

    def get(self, name: str) -> Any:
        """Return the value of a field. Raises KeyError."""
        return getattr(self.message, self._field(name).place)

    def set(self, name: str, value: object) -> None:
        """Set a field, and send it, or at the end of the outermost block of :meth:`editing`.

        Raises BottleError for a value of another type, KeyError for an unknown field, and what ``send`` raises.
        """
        field = self._field(name)
        field.type.put(value)
        with self.editing():
            setattr(self.message, field.place, value)
            self._dirty[name] = field

    def set_item(self, name: str, index: int, value: object) -> None:
        """Set an item of a list; the list is sent whole. Raises IndexError, too."""
        items = list(self.get(name))
        items[index] = value
        self.set(name, items)

    @contextmanager
    def editing(self) -> Iterator[None]:
        """Changes inside the block are sent together at its end."""
        with self._lock:
            self._depth += 1
            try:
                yield
            finally:
                self._depth -= 1
                if self._depth == 0 and self._dirty:
                    patch = self.patch()
                    self._dirty.clear()
                    if self._send is not None:
                        self._send(patch)

    def patch(self) -> Record:
        """Return the message of the fields that were changed and not sent."""
        with self._lock:
            rows = [Record("set", name, self._nested(field)) for name, field in self._dirty.items()]
        return Record("patch", *rows)

    # From afar --------------------------------------------------------------------------------------------------------

    def answer(self, request: Bottle) -> Record | Bottle:
        """Change what a message says, or answer for help. What cannot be done is answered with ``[fail]``."""
        if not len(request):
            return Record(_HELP)
        word, rest = str(request[0]), request.tail().elements()
        if word == "help":
            return self._help(rest)
        try:
            changes = [*self._changes(word, rest)]
        except (BottleError, KeyError):
            return Bottle([FAILED])
        with self._lock:
            for field, value in changes:
                before = getattr(self.message, field.place)
                setattr(self.message, field.place, value)
                if self._changed is not None:
                    self._changed(field.name, before)
        return Record(OK)

    def _changes(self, word: str, rest: list[Value]) -> Iterator[tuple[Field, object]]:
        """Yield fields and values: of ``patch (set x 1) (set y 2)``, or ``set x 1 y 2``. Raises BottleError."""
        if word == "patch":
            triples = [row.elements() if isinstance(row, Bottle) else [] for row in rest]
            if any(len(row) != 3 for row in triples):  # noqa: PLR2004 - set, a name, a value
                raise BottleError("a patch has lists of three")
            pairs = [(str(name), value) for _, name, value in triples]
        elif len(rest) % 2:
            raise BottleError("names and values come in pairs")
        else:
            pairs = [(str(name), value) for name, value in zip(rest[::2], rest[1::2], strict=True)]
        for name, value in pairs:
            field = self._field(name)
            yield field, field.type.take_nested(value)

    def _help(self, rest: list[Value]) -> Record:
        field = self._fields.get(str(rest[0])) if rest else None
        if field is not None:
            lines = [f"{field.type.yarp} {field.name}", *filter(None, [field.doc])]
        else:
            lines = ["*** Available fields:", *self._fields]
        return Record(Vocab("many"), Record(*lines))

    def _field(self, name: str) -> Field:
        try:
            return self._fields[name]
        except KeyError:
            kind = type(self.message).__name__
            raise KeyError(f"{kind} has no field {name}{did_you_mean(name, self._fields)}") from None

    def _nested(self, field: Field) -> object:
        value = field.type.put(getattr(self.message, field.place))
        return Record(*value) if isinstance(value, tuple) else value
