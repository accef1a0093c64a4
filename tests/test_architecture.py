"""The floors of docs/architecture.md: import-linter checks them by the contracts in pyproject.toml."""

from __future__ import annotations

import shutil
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

PROJECT = Path(__file__).parents[1]


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts for the package ``rtf`` in a folder."""
    program = Path(sys.executable).with_name("lint-imports")
    command = [program, "--no-cache", "--no-logo", PROJECT / "pyproject.toml"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_imports_follow_the_architecture():
    """No package imports from a higher floor."""
    result = lint_imports(PROJECT)
    assert result.returncode == 0, result.stdout + result.stderr


def test_no_files_import_each_other_in_a_circle():
    """Every import counts: those for types, and those inside functions."""
    graph = grimp.build_graph("rtf", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(reversed(error.args[1]))}")


def test_imports_for_types_count(tmp_path: Path):
    """A file that needs a higher floor, or its neighbour, for its annotations only is found, too."""
    shutil.copytree(PROJECT / "rtf", tmp_path / "rtf", ignore=shutil.ignore_patterns("__pycache__"))
    for path, line in (
        ("rtf/bottle/errors.py", "from rtf.cli.demo import main"),
        ("rtf/robot/yarp3/values.py", "from rtf.robot.yarp4.values import Kind"),
    ):
        with (tmp_path / path).open("a") as file:
            file.write(f"from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    {line}\n")
    result = lint_imports(tmp_path)
    assert result.returncode == 1, result.stdout + result.stderr
    assert "rtf.bottle.errors -> rtf.cli.demo" in result.stdout
    assert "rtf.robot.yarp3.values -> rtf.robot.yarp4.values" in result.stdout
