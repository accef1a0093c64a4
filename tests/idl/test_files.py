"""Files that are written from interface files: modules that type checkers accept, and documentation."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

from rtf import idl
from rtf.cli.idl import check, html, md, py
from rtf.idl import IdlError
from rtf.idl.documentation import document
from rtf.idl.resolving import program_of

if TYPE_CHECKING:
    from pathlib import Path


def test_a_written_module_is_that_which_is_loaded(shapes_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """It imports, and has no words of Python as names."""
    assert py([str(shapes_file), "-o", str(tmp_path)]) == 0
    monkeypatch.syspath_prepend(str(tmp_path))
    import shapes as written  # type: ignore[import-not-found]

    loaded = idl.load(shapes_file)
    assert written.Shape().codec.to_text(written.Shape()) == loaded.Shape().codec.to_text(loaded.Shape())
    assert [*written.Calculator.FUNCTIONS] == [*loaded.Calculator.FUNCTIONS]
    assert written.Adder.add.__doc__.splitlines()[0] == "Adds two numbers."


def test_a_written_module_is_typed(shapes_file: Path, tmp_path: Path):
    """With mypy --strict a wrong call is found, and nothing else."""
    py([str(shapes_file), "-o", str(tmp_path)])
    use = tmp_path / "use.py"
    use.write_text(
        "from shapes import AdderClient\n\n\ndef use(client: AdderClient) -> int:\n    return client.add('one')\n"
    )
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--cache-dir",
        str(tmp_path / "cache"),
        "--follow-imports=silent",
    ]
    done = subprocess.run([*command, "use.py", "shapes.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert 'use.py:5: error: Argument 1 to "add" of "AdderClient" has incompatible type "str"' in done.stdout
    assert "Found 1 error" in done.stdout


def test_documentation_has_the_comments(shapes_file: Path, capsys: pytest.CaptureFixture[str]):
    """Of functions, fields and values."""
    assert md([str(shapes_file)]) == 0
    text = capsys.readouterr().out
    assert "| `i32 add(i32 a, i32 b = 3)` | Adds two numbers. @return the sum |" in text
    assert "| `centre` | `Point` | {x: 2.0} |  |" in text
    assert "| `BLUE` | 7 |  |" in text
    assert html([str(shapes_file)]) == 0
    assert "<code>i32 add(i32 a, i32 b = 3)</code>" in capsys.readouterr().out
    assert check([str(shapes_file)]) == 0
    assert "2 services, 2 structures, 1 enumerations, 1 constants" in capsys.readouterr().out


def test_texts_of_a_file_stay_texts():
    """In a page and in a module."""
    hostile = '/** <script>x</script> """ \\ */ struct A { 1: string s = \'"""\\\\{{ 1 }}<b>\' }'
    program = program_of(hostile)
    assert "<script>" not in document(program, "html")
    from rtf.idl.python import python_module

    made: Any = python_module(program)
    assert made.A().s == '"""\\{{ 1 }}<b>'
    assert made.A.__doc__ == '<script>x</script> """ \\'


def test_files_of_rtf_are_found_by_name():
    """Only by a name alone; another name says which ones are like it."""
    assert idl.read("battery").structs[0].name == "BatteryData"
    with pytest.raises(IdlError, match=r"control_boards: there is no file, .* did you mean control_board\?"):
        idl.read("control_boards")
    with pytest.raises(IdlError, match="cannot be read"):
        idl.read("./battery.thrift")
