"""Every public method of the library is described where it is first declared; an override needs no docstring."""

from __future__ import annotations

import ast
from pathlib import Path

import rtf

PACKAGE = Path(rtf.__file__).parent
FOLDERS = (PACKAGE, PACKAGE.parent / "fixtures", PACKAGE.parent / "reports", PACKAGE.parent / "icub_tests")


def _undescribed(tree: ast.Module) -> list[str]:
    """Public methods without a docstring of classes that have no base to inherit one from."""
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef) or node.bases or node.name.startswith("_"):
            continue
        found += [
            f"{node.name}.{method.name}"
            for method in node.body
            if isinstance(method, ast.FunctionDef | ast.AsyncFunctionDef)
            and not method.name.startswith("_")
            and not method.decorator_list
            and ast.get_docstring(method) is None
        ]
    return found


def test_public_methods_are_described_where_they_are_declared():
    """A class without a base has a docstring in each public method; subclasses inherit theirs."""
    missing = {
        str(path.relative_to(PACKAGE.parent)): names
        for folder in FOLDERS
        for path in sorted(folder.rglob("*.py"))
        if (names := _undescribed(ast.parse(path.read_text())))
    }
    assert missing == {}
