"""Documentation of interface files for people: Markdown, or a page in one file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from rtf.idl.program import Enum, Fields, Struct

if TYPE_CHECKING:
    from jinja2 import Template

    from rtf.idl.program import Function, Literal, Member, Program, Type

_TEMPLATES = {"md": "document.md.j2", "html": "document.html.j2"}
FORMATS = tuple(_TEMPLATES)


def document(program: Program, form: str) -> str:
    """Return the documentation of a file, without those that it includes; ``form`` is one of :data:`FORMATS`."""
    return _template(form).render(
        program=program,
        declared=_declared,
        prototype=_prototype,
        shown=_shown,
    )


@cache
def _template(form: str) -> Template:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        autoescape=form == "html",  # noqa: S701 - Markdown is no page
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["cell"] = lambda text: str(text).replace("|", "\\|").replace("\n", " ")
    return templates.get_template(_TEMPLATES[form])


def _declared(kind: Type | None) -> str:
    """Return a type as it is written in a file, with the class of YARP that stands for it."""
    if kind is None:
        return "void"
    if kind.native:
        return kind.native
    return f"{kind.name}<{', '.join(map(_declared, kind.items))}>" if kind.items else kind.name


def _prototype(function: Function) -> str:
    arguments = ", ".join(map(_argument, function.arguments))
    return f"{'oneway ' * function.oneway}{_declared(function.returns)} {function.name}({arguments})"


def _argument(member: Member) -> str:
    default = "" if member.default is None else f" = {_shown(member.default, member.type)}"
    return f"{_declared(member.type)} {member.name}{default}"


def _shown(value: Literal | None, kind: Type) -> str:  # noqa: PLR0911 - one for each form
    """Return a value as it is written in a file; empty for none."""
    if value is None:
        return ""
    if isinstance(value, Fields):
        assert isinstance(kind.definition, Struct)
        types = {member.name: member.type for member in kind.definition.members}
        return f"{{{', '.join(f'{name}: {_shown(one, types[name])}' for name, one in value.values.items())}}}"
    if isinstance(kind.definition, Enum):
        return next((one.name for one in kind.definition.values if one.value == value), str(value))
    if isinstance(value, tuple) and kind.name == "map":
        pairs = (pair for pair in value if isinstance(pair, tuple))
        return f"{{{', '.join(f'{_shown(key, kind.items[0])}: {_shown(one, kind.items[1])}' for key, one in pairs)}}}"
    if isinstance(value, tuple):
        return f"[{', '.join(_shown(one, kind.items[0]) for one in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)
