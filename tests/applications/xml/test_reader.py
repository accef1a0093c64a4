"""Reading applications: what elements mean, embedded applications, variables, and the problems of faulty files."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.applications.check import check_application
from rtf.applications.xml.descriptions import find_description, read_computers
from rtf.applications.xml.model import Application, Argument, Channel, PortDependency, Restart, RestartPolicy, Text
from rtf.applications.xml.reader import Loaded, read_application
from rtf.applications.xml.vocabulary import KINDS
from rtf.testing.suite.diagnostics import DiagnosticLog

LAB = """
<application>
  <name>lab</name><description>Two programs</description><version>2</version>
  <authors><author email="a@b">Ada</author><author>Bob</author></authors>
  <var name="robot">icubSim</var> <var name="port">/${robot}/head</var>
  <dependencies><port>/needed</port></dependencies>
  <module>
    <name>yarpdev</name><parameters>--name ${port}
      $ENV{LAB_TEST}</parameters><node>pc104</node><stdio>/console</stdio>
    <workdir>/tmp</workdir><deployer>node</deployer><prefix>/x</prefix><environment>A=1;B=2</environment>
    <display>:0.0</display>
    <dependencies><port timeout="5" request="[get]" reply="[ok]">/a</port></dependencies>
    <ensure><wait>2.5</wait><wait when="stop">1</wait></ensure>
    <portmap><old>/old</old><new>/new</new></portmap>
    <restart attempts="3" backoff="0.5">on-failure</restart>
    <geometry>(Pos (x 1))</geometry>
  </module>
  <connection id="c1" persist="true" qos="level:low">
    <from external="yes">/there</from><to qos="level:high">/x/new</to><protocol>udp</protocol>
  </connection>
  <connection><output>/a</output><input>/b</input></connection>
  <arbitrator><port>/x/new</port><rule connection="c1">NOT c2</rule></arbitrator>
</application>
"""


def load(folder: Path, text: str, **others: str) -> Loaded:
    """Read an application; ``others`` are files beside it, by stem."""
    for name, content in {"main": text, **others}.items():
        (folder / f"{name}.xml").write_text(content)
    return read_application(folder / "main.xml")


def sound(folder: Path, text: str, **others: str) -> Application:
    """Read an application that must have no problem."""
    loaded = load(folder, text, **others)
    assert loaded.diagnostics == ()
    return loaded.application


def test_all_elements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Each element reaches the application that is run, with variables replaced."""
    monkeypatch.setenv("LAB_TEST", "--slow")
    lab = sound(tmp_path, LAB)
    assert (lab.name, lab.description, lab.version, lab.authors) == ("lab", "Two programs", "2", ("Ada", "Bob"))
    assert lab.dependencies == (PortDependency(Text("/needed")),)
    (module,) = lab.modules
    assert module.command == "yarpdev --name /icubSim/head --slow"
    assert (module.node, module.stdio, module.workdir, module.deployer) == ("pc104", "/console", "/tmp", "node")
    assert (module.prefix, module.environment, module.display) == ("/x", "A=1;B=2", ":0.0")
    assert module.dependencies == (PortDependency(Text("/a"), 5.0, "[get]", "[ok]"),)
    assert (module.start_delay, module.stop_delay, module.ports) == (2.5, 1.0, (("/old", "/new"),))
    assert module.restart == Restart(RestartPolicy.ON_FAILURE, 3, 0.5)
    first, second = lab.connections
    assert (first.name, first.persist, first.carrier, str(first)) == ("c1", True, "udp", "/there -> /x/new")
    assert (first.source.external, first.source.qos, first.target.qos) == (True, "level:low", "level:high")
    assert (str(second), second.carrier) == ("/a -> /b", "tcp")
    assert lab.arbitrators[0].rules == (("c1", "NOT c2"),)
    assert str(module.location) == f"{tmp_path}/main.xml:7:3"


def test_tag_is_that_of_yarpmanager(tmp_path: Path):
    """The tags are those that yarpmanager-console 3.12.3 sent to its nodes for the same modules."""
    modules = (
        "<module><name>yarp</name><parameters>read /rd1</parameters><node>node1</node></module>"
        "<module><name>yarp</name><parameters>sample /sm1 --period 0.5</parameters><node>node2</node>"
        "<environment>A=1;B=2</environment></module>"
    )
    lab = sound(tmp_path, f"<application><name>pair</name>{modules}{modules}</application>")
    tags = [module.tag for module in lab.modules]
    assert tags[:2] == [":node1yarpread::rd10", ":node2yarpsample::sm1:--period:0.5A=1;B=20"]
    assert len(set(tags)) == 4


def test_embedded_applications(tmp_path: Path):
    """Prefixes add up and spare external ports; a file is found by its name or by the one inside; variables go down."""
    inner = (
        "<application><name>camera</name><module><name>grabber</name><parameters>${eye}</parameters>"
        "<prefix>/own</prefix></module><connection><from>/grab</from><to external='true'>/view</to></connection>"
        "</application>"
    )
    lab = sound(
        tmp_path,
        "<application><name>both</name><var name='eye'>left</var>"
        "<application><name>a_camera</name><prefix>/l</prefix></application>"
        "<application><name>camera</name><prefix>/r</prefix></application></application>",
        a_camera=inner,
    )
    assert [(one.prefix, one.parameters) for one in lab.modules] == [("/l/own", "left"), ("/r/own", "left")]
    assert [*map(str, lab.connections)] == ["/l/grab -> /view", "/r/grab -> /view"]
    assert [Path(file).name for file in lab.embedded] == ["a_camera.xml", "a_camera.xml"]


def test_template_is_an_application(tmp_path: Path):
    """It is found by its name, and is called after its file if it has none of its own."""
    (tmp_path / "blank.xml.template").write_text("<application><module><name>x</name></module></application>")
    lab = sound(tmp_path, "<application><application><name>blank</name></application></application>")
    assert [one.name for one in lab.modules] == ["x"]
    assert read_application(tmp_path / "blank.xml.template").application.name == "blank"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<module><parameters>x</parameters></module>", "<module> has no name"),
        ("<module><name>a</name><parameters>${bobot}</parameters></module>", "no variable 'bobot' (did you mean 'robo"),
        ("<module><name>a</name><node>$ENV{LAB_NOT_SET}</node></module>", "the environment has no 'LAB_NOT_SET'"),
        ("<module><name>a</name><ensure><wait>soon</wait></ensure></module>", "<wait> is seconds from 0 to 86400, not"),
        (
            "<module><name>a</name><ensure><wait when='now'>1</wait></ensure></module>",
            "start or stop, not 'now'",
        ),
        ("<module><name>a</name><restart>often</restart></module>", "<restart> is one of never, on-failure, always"),
        ("<module><name>a</name><restart attempts='0'>always</restart></module>", "attempts is a whole number from 1"),
        ("<connection><from>/a</from></connection>", "<connection> has no <to> (it needs <from> and <to>)"),
        ("<connection><from>a b</from><to>/b</to></connection>", "'a b' is no port (it begins with '/'"),
        (
            "<connection><from external='maybe'>/a</from><to>/b</to></connection>",
            "is true or false, not 'maybe'",
        ),
        ("<modul/>", "warning: <modul> in <application> has no meaning (did you mean module?)"),
        ("<connection presist='true'><from>/a</from><to>/b</to></connection>", "did you mean persist?"),
        (
            "<application><name>gone</name></application>",
            "no application 'gone' (put its file beside main.xml",
        ),
        ("<application><name>main</name></application>", "the application embeds itself: main.xml -> main.xml"),
        ("<application><name>broken</name></application>", "broken.xml:1:14: error: this is not well-formed"),
        ("<var name='huge'>${long}${long}${long}${long}${long}${long}${long}</var>", "longer than 65536 characters"),
    ],
)
def test_problems_have_a_place(tmp_path: Path, content: str, message: str):
    """Each is reported with file, line and column, and reading goes on."""
    long = f"<var name='robot'/><var name='long'>{'x' * 10000}</var>"
    loaded = load(tmp_path, f"<application>{long}\n{content}</application>", broken="<application>")
    (found,) = map(str, loaded.diagnostics)
    assert message in found
    assert f"{tmp_path}/main.xml:2:" in found or "broken.xml:1:14" in found


def test_circle_through_several_files_is_reported_with_all_of_them(tmp_path: Path):
    """The chain names the files in the order in which they embed each other."""
    embed = "<application><application><name>{}</name></application></application>"
    loaded = load(tmp_path, embed.format("b"), b=embed.format("c"), c=embed.format("main"))
    assert "main.xml -> b.xml -> c.xml -> main.xml" in str(loaded.diagnostics[0])


def test_few_lines_cannot_ask_for_billions_of_modules(tmp_path: Path):
    """Applications that embed each other forty times are refused where they become too many."""
    embed = "<application>" + "<application><name>{0}</name></application>" * 40 + "</application>"
    files = {name: embed.format(following) for name, following in zip("bcd", "cde", strict=True)}
    loaded = load(tmp_path, embed.format("b"), **files, e="<application><module><name>x</name></module></application>")
    assert any("more than 1000 embedded applications" in str(one) for one in loaded.diagnostics)


def test_other_file_is_no_application(tmp_path: Path):
    """The error says what the file holds."""
    (found,) = load(tmp_path, "<suite/>").diagnostics
    assert "main.xml:1:1: error: the file holds <suite>" in str(found)


words = st.sampled_from(["", "/a", "x", "${v}", "$ENV{HOME}", "${", "1", "-1", "nan", "true", "start", "lab", "always"])
parts = st.sampled_from(sorted({name for kind in KINDS.values() for name in kind.children}))
attributes = st.dictionaries(st.sampled_from(["name", "timeout", "when", "persist", "external", "attempts"]), words)


def written(tag: str, content: dict[str, str], inside: list[str], text: str) -> str:
    """Write an element."""
    start = "".join(f' {name}="{value}"' for name, value in content.items())
    return f"<{tag}{start}>{text}{''.join(inside)}</{tag}>"


elements = st.recursive(
    st.builds(written, parts, attributes, st.just([]), words),
    lambda inner: st.builds(written, parts, attributes, st.lists(inner, max_size=4), words),
    max_leaves=12,
)


#: Sound ones, too, with anything besides what they must have.
filled = st.builds(
    lambda pair, inside: written(pair[0], {}, [pair[1], *inside], ""),
    st.sampled_from(
        [
            ("module", "<name>x</name>"),
            (
                "module",
                "<name>x</name><dependencies><port>/a/in</port></dependencies><parameters>--name /a</parameters>",
            ),
            ("connection", "<from>/a</from><to external='true'>/b</to>"),
            ("arbitrator", "<port>/a</port>"),
            ("application", "<name>main</name>"),
        ]
    ),
    st.lists(elements, max_size=2),
)


@given(st.lists(elements | filled, max_size=5))
def test_any_arrangement_of_known_elements_is_read_or_reported(content: list[str]):
    """The reader raises nothing: what cannot be used is a problem with a place."""
    with TemporaryDirectory() as folder:
        loaded = load(Path(folder), f"<application>{''.join(content)}</application>")
        assert all(one.line for one in loaded.diagnostics)
        for module in loaded.application.modules:
            assert module.name
            assert " " not in module.tag
        problems = DiagnosticLog()
        check_application(loaded.application, problems)
        Path(folder, "modules").mkdir()
        Path(folder, "modules", "x.xml").write_text(f"<module>{''.join(content)}</module>")
        find_description("x", Path(folder), problems)


def test_descriptions_and_machines(tmp_path: Path):
    """A program's description is found beside the application; figures of machines have names with dots."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "grabber.xml").write_text(
        "<module><name>grabber</name><arguments><param required='yes' default='/g' desc='its port'>name</param>"
        "<switch>verbose</switch></arguments><data><input><type>Bottle</type><port carrier='udp'>/g/in</port>"
        "<required>yes</required></input><output><type>ImageOf</type><port>/g/out</port></output></data>"
        "<services><server><port>/g/rpc</port></server></services>"
        "<dependencies><computer><memory><free>4</free></memory></computer></dependencies></module>"
    )
    problems = DiagnosticLog()
    found = find_description("/opt/bin/grabber", tmp_path, problems)
    assert found is not None
    assert found.arguments == (Argument("name", True, "/g", "its port"), Argument("verbose", switch=True))
    assert found.inputs == (Channel(Text("/g/in"), "Bottle", "udp", required=True),)
    assert [one.port for one in (*found.outputs, *found.servers)] == ["/g/out", "/g/rpc"]
    assert found.needs == ({"memory.free": "4"},)
    lab = tmp_path / "lab.xml"
    lab.write_text("<resources><computer><name>pc</name><disable>yes</disable><os>Linux</os></computer></resources>")
    (computer,) = read_computers(lab, problems)
    assert (computer.name, computer.disabled, computer.figures) == ("pc", True, {"os": "Linux"})
    assert [*problems] == []
    (tmp_path / "modules" / "grabber.xml").write_text("<application/>")
    assert find_description("grabber", tmp_path, problems) is None
    assert "the file holds <application>, not <module>" in str(next(iter(problems)))
