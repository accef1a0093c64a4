"""Places in an author's files, for calls and exceptions."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtf.testing.session import calling_place, raised_place

_LAYER = """
def call(place_of):
    return place_of()

def fail(error):
    raise error
"""

_PLUGIN = """
def call(place_of):
    return layer.call(place_of)

def fail(error):
    layer.fail(error)
"""


@pytest.fixture
def modules(tmp_path: Path):
    """A library module, and a module loaded as a plug-in that uses it."""

    def load(name: str, text: str):
        path = tmp_path / f"{name.rpartition('.')[2]}.py"
        path.write_text(text)
        names = {"__name__": name}
        exec(compile(text, str(path), "exec"), names)
        return path, names

    layer_path, layer = load("layer", _LAYER)
    plugin_path, plugin = load("rtf_plugins.test.careful", _PLUGIN)
    plugin["layer"] = type("Layer", (), {name: staticmethod(layer[name]) for name in ("call", "fail")})
    return layer_path, layer, plugin_path, plugin


def test_a_call_through_a_layer_is_the_plugins(modules):
    """The place of a call through a library is the plug-in's line."""
    layer_path, layer, plugin_path, plugin = modules

    def place():
        return calling_place(__file__)

    assert plugin["call"](place) == (str(plugin_path), 3)
    assert layer["call"](place) == (str(layer_path), 3), "without a plug-in the nearest"


def test_an_error_of_a_layer_is_the_plugins(modules):
    """The place of an error in a library is the plug-in's line; without a plug-in it is the innermost."""
    layer_path, layer, plugin_path, plugin = modules
    with pytest.raises(ValueError, match="no") as caught:
        plugin["fail"](ValueError("no"))
    assert raised_place(caught.value) == (str(plugin_path), 6)
    with pytest.raises(ValueError, match="no") as caught:
        layer["fail"](ValueError("no"))
    assert raised_place(caught.value) == (str(layer_path), 6)


def test_a_module_without_a_name_is_no_plugin():
    """Executed text without a module name is no plug-in."""
    names: dict[str, object] = {"__name__": None, "calling_place": calling_place}
    exec(compile("place = calling_place('nothing')", "text", "exec"), names)
    assert names["place"] == ("text", 1)
