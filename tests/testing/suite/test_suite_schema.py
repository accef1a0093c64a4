"""The published schema agrees with the loader and with the samples."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from lxml import etree

from rtf.testing.suite.elements import KINDS
from rtf.testing.suite.xml import SCHEMA, load_suite_bytes

DATA = Path(__file__).parents[2] / "data" / "suites"
XS = "{http://www.w3.org/2001/XMLSchema}"
SAMPLES = sorted(DATA.rglob("*.xml"))


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    """The published schema."""
    return etree.XMLSchema(etree.parse(SCHEMA))


def declarations() -> dict[str, etree._Element]:
    """Return the schema's declaration of each element."""
    return {element.get("name"): element for element in etree.parse(SCHEMA).getroot().findall(f"{XS}element")}


def test_schema_and_loader_know_the_same_elements():
    """Schema and loader have the same elements."""
    assert set(KINDS) == set(declarations())


@pytest.mark.parametrize("name", KINDS)
def test_schema_and_loader_know_the_same_attributes_and_children(name: str):
    """Schema and loader have the same attributes and children of each element."""
    element = declarations()[name]
    assert KINDS[name].attributes.keys() == {attribute.get("name") for attribute in element.iter(f"{XS}attribute")}
    assert KINDS[name].children == {child.get("ref") for child in element.iter(f"{XS}element") if child.get("ref")}


def test_everything_in_the_schema_is_explained():
    """Every declaration has a documentation, which editors show."""
    nodes = etree.parse(SCHEMA).getroot().iter(f"{XS}element", f"{XS}attribute", f"{XS}enumeration", f"{XS}simpleType")
    unexplained = [
        node.get("name") or node.get("value")
        for node in nodes
        if (node.get("name") or node.get("value")) and not node.findtext(f"{XS}annotation/{XS}documentation")
    ]
    assert unexplained == []


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_the_samples_are_valid(schema: etree.XMLSchema, path: Path):
    """The samples are valid, but for double dashes in comments."""
    text = re.sub(r"<!--.*?-->", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    schema.assertValid(etree.fromstring(text.encode()))


BAD = {
    "unknown attribute": '<suite name="S"><test retrys="1">A</test></suite>',
    "unknown element": '<suite name="S"><tset>A</tset></suite>',
    "another root": "<suit name='S'/>",
    "fixture in a loop": '<suite name="S"><for name="a" in="b"><fixture>F</fixture></for></suite>',
    "negative retries": '<suite name="S"><test retries="-1">A</test></suite>',
    "too many retries": '<suite name="S"><test retries="1001">A</test></suite>',
    "no duration": '<suite name="S"><test timeout="soon">A</test></suite>',
    "no duration in the element": '<suite name="S"><timeout>soon</timeout></suite>',
    "unknown isolation": '<suite name="S" isolation="thread"/>',
    "unknown scope": '<suite name="S"><fixture scope="test">F</fixture></suite>',
    "unknown outcome": '<suite name="S"><test expected="maybe">A</test></suite>',
    "unknown policy": '<suite name="S" on-lost="pray"/>',
    "parameter without a name": '<suite name="S"><parameter>1</parameter></suite>',
    "loop without values": '<suite name="S"><for name="a"><test>A</test></for></suite>',
    "stray text": '<suite name="S">A</suite>',
}
GOOD = {
    "variables in place of values": (
        '<suite name="S" timeout="${t}" isolation="${i}" retries="${n}"><timeout>${t}</timeout>'
        '<test expected="${e}" repetition="1${n}">A</test></suite>'
    ),
    "nothing": '<suite name="S"/>',
    "elements in any order": '<suite name="S"><parameter name="p"/>'
    "<test>A</test><fixture>F</fixture><description/></suite>",
}
VARIABLES = {"t": "5", "i": "suite", "n": "1", "e": "pass"}


@pytest.mark.parametrize("text", BAD.values(), ids=BAD)
def test_what_the_schema_rejects_the_loader_complains_about(schema: etree.XMLSchema, text: str):
    """What the schema rejects is a problem of the loader, too."""
    assert not schema.validate(etree.fromstring(text))
    assert load_suite_bytes(text.encode(), "s.xml").diagnostics


@pytest.mark.parametrize("text", GOOD.values(), ids=GOOD)
def test_what_the_schema_accepts_the_loader_accepts(schema: etree.XMLSchema, text: str):
    """What the schema accepts loads without a problem, variables included."""
    schema.assertValid(etree.fromstring(text))
    assert load_suite_bytes(text.encode(), "s.xml", variables=VARIABLES).diagnostics == ()
