"""The floors of ``rtf.middleware``: each imports only from those below it, types included, without circles."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import rtf.middleware

PACKAGE = Path(rtf.middleware.__file__).parent
NAME = "rtf.middleware"
#: From the lowest to the highest. ``rtf.middleware`` itself joins them.
FLOORS = ("errors", "types", "wire", "carriers", "ports", "naming", "clocks", "tools")


def modules() -> dict[str, Path]:
    """Return all modules by name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join((NAME, *parts)).removesuffix(".__init__")] = path
    return found


def imports(path: Path, known: dict[str, Path]) -> set[str]:
    """Return the modules of the package that a file imports anywhere, also for types only or when they are needed."""
    wanted = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            wanted |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            wanted |= {
                whole if (whole := f"{node.module}.{alias.name}") in known else node.module for alias in node.names
            }
    return wanted & known.keys()


def floor_of(module: str) -> int:
    """Return the number of a module's floor."""
    return FLOORS.index(module.removeprefix(f"{NAME}.").partition(".")[0])


def test_every_file_is_on_a_floor() -> None:
    """No file is beside the floors."""
    assert {path.relative_to(PACKAGE).parts[0] for path in modules().values()} == {
        "__init__.py",
        "errors.py",
        *FLOORS[1:],
    }


def test_floors_import_downwards() -> None:
    """A file knows nothing of a higher floor."""
    known = modules()
    upwards = [
        f"{module} imports {wanted}"
        for module, path in known.items()
        if module != NAME
        for wanted in imports(path, known)
        if wanted == NAME or floor_of(wanted) > floor_of(module)
    ]
    assert upwards == []


def test_no_circles() -> None:
    """Files can be read one after the other, each after all that it uses."""
    known = modules()
    graph = {module: imports(path, known) - {module} for module, path in known.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" -> ".join(error.args[1])) from None


def test_wire_uses_no_sockets_threads_or_clocks() -> None:
    """The wire floor is the protocol on bytes."""
    for module, path in modules().items():
        if module.startswith(f"{NAME}.wire"):
            top = {
                name.partition(".")[0]
                for node in ast.walk(ast.parse(path.read_text("utf-8")))
                for name in (
                    [alias.name for alias in node.names]
                    if isinstance(node, ast.Import)
                    else [node.module or ""]
                    if isinstance(node, ast.ImportFrom)
                    else []
                )
            }
            assert not top & {"socket", "threading", "select", "selectors", "time", "asyncio", "subprocess"}, module
