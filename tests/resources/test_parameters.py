"""Finding the parameters of a robot test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Property
from rtf.resources import (
    DEFAULT_CONTEXT,
    DiagnosticKind,
    Parameters,
    ResourceNotFoundError,
    ResourceSyntaxError,
    find_parameters,
)

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(name="data")
def _data(tmp_path: Path) -> Path:
    for context in (DEFAULT_CONTEXT, "icub", "icubSim", "other"):
        folder = tmp_path / "data" / "contexts" / context
        folder.mkdir(parents=True)
        (folder / f"only_{context}.ini").write_text(f"context {context}\nport /${{robotname}}/head")
        (folder / "shared.ini").write_text(f"context {context}")
    return tmp_path


def find(data: Path, arguments: str, environment: str = "") -> Parameters:
    """Find parameters in the folder of this test."""
    return find_parameters(arguments, environment, process_environment={"YARP_DATA_HOME": str(data / "data")}, cwd=data)


@pytest.mark.parametrize(
    ("arguments", "environment", "context"),
    [
        ("--from shared.ini", "", DEFAULT_CONTEXT),
        ("--from shared.ini", "--context icub", "icub"),
        ("--from shared.ini --context other", "--context icub", "other"),
        ("--from shared.ini", "--robotname icubSim", DEFAULT_CONTEXT),
        ("--from only_icubSim.ini", "--robotname icubSim", "icubSim"),
        ("--from contexts/icub/shared.ini", "--context icubSim", "icub"),
    ],
)
def test_the_context(data: Path, arguments: str, environment: str, context: str):
    """The context is that of the test, the suite, or the robot's name, in this order."""
    found = find(data, arguments, environment)
    assert found.properties.find("context") == context
    assert found.file is not None
    assert context in found.file.parts


@pytest.mark.parametrize("environment", ["", "--context icub --robotname icubSim", "--robotname nobody"])
def test_a_file_that_is_not_found(data: Path, environment: str):
    """The error about a missing file lists the places of every search; with a context the robot's name is not tried."""
    with pytest.raises(ResourceNotFoundError, match=r"only_icubSim\.ini: not found"):
        find(data, "--from only_icubSim.ini", environment)


def test_every_lookup_is_reported(data: Path):
    """The searches in the default context and in that of the robot are both returned."""
    found = find(data, "--from only_icubSim.ini", "--robotname icubSim")
    assert [search.path is None for search in found.searches] == [True, False]


def test_variables_come_from_the_environment_of_the_suite(data: Path):
    """Keys of the environment string are variables of the file."""
    found = find(data, "--from only_icub.ini", "--context icub --robotname icubSim")
    assert found.properties.find("port") == "/icubSim/head"
    assert found.diagnostics == ()
    found = find(data, "--from only_icub.ini", "--context icub")
    assert [item.kind for item in found.diagnostics] == [DiagnosticKind.UNDEFINED_VARIABLE]


def test_other_arguments_do_not_change_the_file(data: Path):
    """With a file other arguments are not parameters, but are returned."""
    found = find(data, "--from shared.ini --context icub --speed 5")
    assert found.properties == Property({"context": "icub"})
    assert found.arguments.find("speed") == 5


def test_without_a_file_the_arguments_are_the_parameters(data: Path):
    """Without a file all arguments are parameters."""
    found = find(data, '--name "a b" --joints (0,1)', "--robotname icubSim")
    assert found.properties == Property.parse('(name "a b") (joints (0 1))')
    assert (found.file, found.searches) == (None, ())
    assert found.environment.find("robotname") == "icubSim"


def test_an_empty_name_is_an_error(data: Path):
    """``--from`` without a file is an error."""
    with pytest.raises(ResourceSyntaxError, match="--from"):
        find(data, "--from --context icub")


def test_the_current_directory_wins(data: Path):
    """A file in the current directory is found first, and hidden ones are reported."""
    (data / "shared.ini").write_text("context here")
    found = find(data, "--from shared.ini", "--context icub")
    assert found.properties.find("context") == "here"
    assert any("shadowed" in line for line in found.searches[0].lines())
