"""The reader of robot files: elements, parameters, includes, and all problems of a robot in one error."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rtf import xml_tree
from rtf.bottle import Bottle, Property
from rtf.robot.errors import ConfigurationError
from rtf.robot.interface import includes
from rtf.robot.interface.model import ActionKind, Phase
from rtf.robot.interface.problems import MAX_PROBLEMS, RobotFileError
from rtf.robot.interface.robot_reader import read_robot
from scripted_devices import DOCTYPE, robot_xml
from scripted_devices import action_xml as action
from scripted_devices import device_xml as device

if TYPE_CHECKING:
    from conftest import Bench

RECORDED = Path(__file__).parents[2] / "data" / "yarp_config" / "fakerobot.xml"


def configuration(bench: Bench, inside: str, **given: object) -> Property:
    """Return the configuration of the only device, without the entries that every device gets."""
    (entry,) = bench.read(f'<device name="d" type="t">{inside}</device>', **given).robot.devices
    handed = entry.configuration.copy()
    assert [handed.find(key) for key in ("id", "device")] == ["d", "t"]
    for key in ("id", "device", "robotName"):
        handed.remove(key)
    return handed


def problems(bench: Bench, inside: str, attributes: str = 'build="1" portprefix="/bot"') -> list[str]:
    """Return the problems of a robot, with places relative to the bench's folder."""
    with pytest.raises(RobotFileError) as raised:
        bench.read(inside, attributes)
    return [str(one).replace(f"{bench.folder}/", "") for one in raised.value.problems]


class TestRobot:
    """The file of the real program, and the attributes of a robot."""

    def test_a_real_file_in_full(self):
        """The reader returns every device with its configuration, and every action with its target and place."""
        reading = read_robot(RECORDED)
        robot = reading.robot
        assert (robot.name, robot.build, robot.portprefix) == ("icubSim", 2, "icubSim")
        assert robot.port_name == "/icubSim/yarprobotinterface"
        assert {entry.name: entry.kind for entry in robot.devices} == {
            "head_mc": "fakeMotionControl",
            "left_arm_mc": "fakeMotionControl",
            "cam_left": "fakeFrameGrabber",
            "imu": "fakeIMU",
            "head_nws": "controlBoard_nws_yarp",
            "left_arm_nws": "controlBoard_nws_yarp",
            "cam_nws": "frameGrabber_nws_yarp",
            "imu_nws": "multipleanalogsensorsserver",
        }
        head, camera, stub = (robot.device(name) for name in ("head_mc", "cam_left", "head_nws"))
        general = head.configuration.find_group("GENERAL")
        assert general.find("Joints") == 6
        assert general.find("AxisName")[5] == "eyes_verg"
        assert [*head.configuration.find_group("LIMITS").find("Min")] == [-40, -20, -50, -35, -50, 0]
        assert camera.configuration.find("period") == 0.033
        assert camera.configuration.find("fakeFrameGrabber_rpc_port") == "/icubSim/fakeFrameGrabber/rpc"
        assert stub.configuration.find("robotName") == "icubSim"
        assert str(stub.configuration.location("name")).endswith("fakerobot.xml:31:9")
        for phase, kind in ((Phase.STARTUP, ActionKind.ATTACH), (Phase.SHUTDOWN, ActionKind.DETACH)):
            ((level, actions),) = robot.levels(phase)
            assert level == 5
            assert [one.kind for one in actions] == [kind] * 4
            assert [one.device for one in actions] == ["head_nws", "left_arm_nws", "cam_nws", "imu_nws"]
        (warning,) = reading.warnings
        assert "does not begin with '/'" in warning.sentence

    def test_prefix_from_the_command_line(self, bench: Bench):
        """A prefix of the command line replaces the one of the file in ports, parameters and robotName."""
        inside = device("d", "t", local="${portprefix}/head")
        robot = bench.read(inside, portprefix="/other").robot
        assert robot.port_name == "/other/yarprobotinterface"
        assert robot.devices[0].configuration.find("local") == "/other/head"
        assert robot.devices[0].configuration.find("robotName") == "/other"

    def test_default_of_the_prefix(self, bench: Bench):
        """Without a prefix the robot's name is the prefix, as in the original."""
        reading = bench.read("", 'build="1"')
        assert reading.robot.portprefix == "bot"
        assert reading.robot.port_name == "/bot/yarprobotinterface"

    def test_defaults_are_reported(self, bench: Bench):
        """A missing build is 0 and a missing document type is version 3, each with a warning."""
        path = bench.folder / "bare.xml"
        path.write_text('<robot name="r" portprefix="/r"/>')
        reading = read_robot(path)
        assert reading.robot.build == 0
        assert [one.sentence for one in reading.warnings] == [
            "the file has no document type, 3.0 is assumed",
            "<robot> has no build, 0 is assumed",
        ]

    @pytest.mark.parametrize(
        ("version", "complaint"),
        [
            ("1.0", "--allow-deprecated-dtd"),
            ("2.0", "never supported"),
            ("4.0", "not known"),
            ("x", "is not a document type"),
        ],
    )
    def test_versions_that_are_not_read(self, bench: Bench, version: str, complaint: str):
        """The error has the line of the document type and the remedy; an option allows version 1."""
        path = bench.folder / "old.xml"
        path.write_text(robot_xml("").replace("3.0//EN", f"{version}//EN"))
        with pytest.raises(RobotFileError, match=complaint) as raised:
            read_robot(path)
        assert str(raised.value).startswith(f"{path}:2:1: ")
        if version == "1.0":
            assert read_robot(path, allow_deprecated_dtd=True).robot.name == "bot"

    @pytest.mark.parametrize(
        ("attributes", "complaint"),
        [
            ('build="-1"', "whole number"),
            ('build="x"', "whole number"),
            ('build="99999999999"', "whole number"),
            ('build="1" portprefix="/a b"', "is not a port name"),
            ('build="1" reverse-shutdown-action-order="maybe"', "true or false"),
        ],
    )
    def test_attributes_that_make_no_sense(self, bench: Bench, attributes: str, complaint: str):
        """Each invalid attribute of ``<robot>`` is reported with its place."""
        (problem,) = problems(bench, "", attributes)
        assert problem.startswith("robot.xml:3:1: ")
        assert complaint in problem


class TestParameters:
    """The configuration that a device gets."""

    def test_texts_are_values(self, bench: Bench):
        """The text of a parameter is a number, a word, a quoted text, a list, several values, or none."""
        handed = configuration(
            bench,
            """<param name="n"> 7 </param><param name="f">0.5</param><param name="w">word</param>
            <param name="q">"two words"</param><param name="l">(1 2
            3)</param><param name="s">1 2</param><param name="e"/>""",
        )
        expected = '(n 7) (f 0.5) (w word) (q "two words") (l (1 2 3)) (s 1 2) (e)'
        assert handed == Property.parse(expected)

    def test_lists_of_parameters(self, bench: Bench):
        """A paramlist is a list of its elements' names, and each element a parameter."""
        handed = configuration(
            bench,
            '<paramlist name="networks"><elem name="arm">(0 3 0 3)</elem><elem name="hand">dev</elem></paramlist>',
        )
        assert handed == Property.parse("(networks (arm hand)) (arm (0 3 0 3)) (hand dev)")

    def test_groups(self, bench: Bench):
        """Groups nest, groups of one name are merged, and the first of two equal keys counts."""
        handed = configuration(
            bench,
            """<group name="A"><param name="x">1</param><group name="B"><param name="y">2</param></group></group>
            <params><param name="z">3</param></params>
            <group name="A"><param name="x">9</param><group name="B"><param name="v">4</param></group></group>""",
        )
        assert handed == Property.parse("(A (x 1) (B (y 2) (v 4))) (z 3)")
        assert str(handed.location("A")).endswith("robot.xml:4:27")

    def test_shared_parameters_come_first(self, bench: Bench):
        """Parameters of ``<devices>`` come before those of each device in it, at any depth and in any order."""
        inside = f"""<param name="of_robot">0</param><devices robot="bot" build="1"><devices>{device("d", own="3")}
            <param name="inner">2</param></devices><param name="outer">1</param></devices>{device("other")}"""
        robot = bench.read(inside).robot
        assert [*robot.device("d").configuration] == ["id", "device", "robotName", "outer", "inner", "own"]
        assert [*robot.device("other").configuration] == ["id", "device", "robotName"]
        assert robot.parameters == Property({"of_robot": 0})

    def test_substitutions(self, bench: Bench):
        """Variables for the prefix and the robot's name are replaced; an unknown one stays, with a warning."""
        handed = configuration(bench, '<param name="p">"${portprefix} ${portprefixnoslash} ${robotname} ${x}"</param>')
        assert handed.find("p") == "/bot bot bot ${x}"
        reading = bench.read(device("d", p="${x}"))
        assert [one.sentence for one in reading.warnings] == [
            "${x} is not replaced; the known variables are ${portprefix}, ${robotname}, ${portprefixnoslash}"
        ]

    @pytest.mark.parametrize(
        ("given", "value"),
        [(5, "(p 5)"), ("a", "(p a)"), ("1 2", "(p 1 2)"), (Bottle([1, 2]), "(p (1 2))"), (None, "(p 0)")],
    )
    def test_names_of_the_command_line(self, bench: Bench, given: object, value: str):
        """An option replaces the text of a parameter with its extern-name; without it the text counts."""
        inside = '<param name="p" extern-name="e">0</param>'
        assert configuration(bench, inside, **({} if given is None else {"e": given})) == Property.parse(value)
        assert bench.read(device("d", inside=inside)).asked == {"e"}

    def test_several_values_of_the_command_line_are_a_list(self, bench: Bench):
        """Several values of an option are one list, as a list in an option is written without quotes."""
        path = bench.folder / "r.xml"
        path.write_text(robot_xml('<device name="d" type="t"><param name="p" extern-name="e">0</param></device>'))
        given = Property()
        given.put("e", 1, 2)
        assert read_robot(path, given).robot.devices[0].configuration.find_group("p") == Bottle.parse("p (1 2)")

    def test_entries_of_every_device_cannot_be_changed(self, bench: Bench):
        """A parameter named as an automatic entry gives a warning, and the automatic value stays."""
        reading = bench.read(device("d", "t", device="x"))
        assert reading.robot.devices[0].configuration.find("device") == "t"
        assert "is always 't'" in reading.warnings[0].sentence

    def test_what_cannot_be_read(self, bench: Bench):
        """The error has all problems at once, each with its place and its hint."""
        found = problems(
            bench,
            """<device name="d" type="t"><param name="a">1</param>
<param name="a">2</param>
<param name="b">(1 2</param>
<param>3</param>
<param name="c"><param name="d">1</param></param>
<group name="g"><device name="e" type="t"/></group>
<paramlist name="l"><param name="m">1</param></paramlist>
<params file="other.xml"/>
</device>
<device name="d" type="t"/>
<device type="t"/><device name="x"/>
<what/>""",
        )
        expected = {
            "robot.xml:5:1: the device 'd' has the parameter 'a' twice, first in robot.xml:4:27; keep one",
            "robot.xml:6:1: the value of 'b' cannot be read: its quotes or brackets are not closed; fix the value",
            'robot.xml:7:1: <param> has no name; write name="…"',
            "robot.xml:8:17: <param> is not allowed in <param>; only text is allowed here",
            (
                "robot.xml:9:17: <device> is not allowed in <group>; allowed here:"
                " <group>, <param>, <paramlist>, <params>"
            ),
            "robot.xml:10:21: <param> is not allowed in <paramlist>; allowed here: <elem>",
            (
                "robot.xml:11:1: <params> includes 'other.xml' by its attribute 'file', which is not allowed any more;"
                ' write <xi:include href="…"/>'
            ),
            "robot.xml:13:1: there is a device 'd' already, in robot.xml:4:1; rename one",
            'robot.xml:14:1: <device> has no name; write name="…"',
            "robot.xml:14:19: the device 'x' has no type; write type=\"…\"",
            (
                "robot.xml:15:1: <what> is not allowed in <robot>; allowed here: <device>, <devices>, <group>,"
                " <param>, <paramlist>, <params>"
            ),
        }
        assert {one.replace(f"{bench.folder}/", "") for one in found} == expected

    def test_what_has_no_meaning_is_a_warning(self, bench: Bench):
        """Attributes and texts without a meaning are warnings."""
        reading = bench.read('<devices color="red">stray<device name="d" type="t">text</device></devices>')
        assert [one.sentence for one in reading.warnings] == [
            "the attribute 'color' of <devices> has no meaning",
            "the text 'stray' in <devices> has no meaning",
            "the text 'text' in <device> has no meaning",
        ]


class TestActions:
    """The actions of a device, and the checks of their parameters."""

    def test_actions_in_actions(self, bench: Bench):
        """``<actions>`` may be nested; an action of the phase run gives a warning and is left out."""
        inside = (
            f'<actions robot="bot" build="1">{action("detach")}<actions>{action("abort", "run")}</actions></actions>'
        )
        reading = bench.read(device("d", inside=inside))
        assert [one.kind for one in reading.robot.devices[0].actions] == [ActionKind.DETACH]
        assert "the phase run has none" in reading.warnings[0].sentence

    @pytest.mark.parametrize(
        ("parameters", "complaint"),
        [
            ({}, "it has nothing; write one of 'device'"),
            ({"device": "other", "all": "1"}, "it has device and all"),
            ({"network": "other"}, "it has network"),
            ({"device": "othr"}, "there is no device 'othr'; is it 'other'?"),
            ({"device": "zzz"}, "there is no device 'zzz'; known are other"),
            ({"device": "d"}, "cannot be its own target"),
            ({"networks": "(a)"}, "the network 'a' has no device"),
            ({"networks": "()"}, "names no network"),
            ({"networks": "(a a)", "a": "other"}, "names a network twice"),
        ],
    )
    def test_what_cannot_be_attached(self, bench: Bench, parameters: dict[str, str], complaint: str):
        """A wrong target of an attach is a problem of the file, with device, action and place."""
        (problem,) = problems(bench, device("d", inside=action("attach", **parameters)) + device("other"))
        assert problem.startswith("robot.xml:4:")
        assert "attach of d (startup, level 1): " in problem
        assert complaint in problem

    @pytest.mark.parametrize("kind", ["calibrate", "park"])
    @pytest.mark.parametrize(
        ("parameters", "complaint"), [({}, "no device to move"), ({"target": "x"}, "no device 'x'")]
    )
    def test_what_cannot_be_moved(self, bench: Bench, kind: str, parameters: dict[str, str], complaint: str):
        """A calibrate or park without an existing target is a problem of the file."""
        (problem,) = problems(bench, device("d", inside=action(kind, **parameters)))
        assert complaint in problem

    @pytest.mark.parametrize(
        ("text", "complaint"),
        [
            ('phase="begin" level="1" type="attach"', "the phase of <action> is one of startup, interrupt1"),
            ('phase="unknown" level="1" type="detach"', "the phase of <action> is one of startup"),
            ('level="1" type="detach"', "there is none"),
            ('phase="startup" level="-1" type="detach"', "whole number from 0; '-1' is not"),
            ('phase="startup" level="1" type="dance"', "is one of attach, detach, calibrate"),
        ],
    )
    def test_attributes_that_make_no_sense(self, bench: Bench, text: str, complaint: str):
        """Each invalid attribute of ``<action>`` is reported with its place."""
        (problem,) = problems(bench, f'<device name="d" type="t"><action {text}/></device>')
        assert problem.startswith("robot.xml:4:27: ")
        assert complaint in problem

    @pytest.mark.parametrize("timeout", ["0", "-1", "nan", "inf", "x", "1e9", ""])
    def test_times_that_make_no_sense(self, bench: Bench, timeout: str):
        """A timeout must be a finite number above 0, up to a day, so that a slip cannot stall the robot."""
        (problem,) = problems(bench, device("d", inside=action("detach", timeout=timeout)))
        assert "the timeout is a number of seconds up to 86400" in problem


class TestIncludes:
    """Robots in several files."""

    def write(self, bench: Bench, **files: str) -> Path:
        """Write files, and return the path of the one named ``main``; ``__`` in a name is a folder's slash."""
        for name, text in files.items():
            path = bench.folder / name.replace("__", "/")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.with_suffix(".xml").write_text(text, encoding="utf-8")
        return bench.folder / "main.xml"

    def test_forms_of_files(self, bench: Bench):
        """An included file has devices, a device, parameters, a group, actions or an action, and includes others."""
        main = self.write(
            bench,
            main=robot_xml('<devices><xi:include href="hw/devices.xml"/></devices><xi:include href="hw/one.xml"/>'),
            hw__devices='<devices><xi:include href="deep/params.xml"/><device name="a" type="t"/></devices>',
            hw__one=(
                '<device name="b" type="t"><xi:include href="../group.xml"/>'
                '<xi:include href="deep/actions.xml"/></device>'
            ),
            hw__deep__params='<params><param name="p">1</param></params>',
            group='<group name="G"><param name="q">${robotname}</param></group>',
            hw__deep__actions='<actions><xi:include href="action.xml"/></actions>',
            hw__deep__action=action("attach", device="a"),
        )
        robot = read_robot(main).robot
        assert [entry.name for entry in robot.devices] == ["a", "b"]
        assert robot.device("a").configuration.find("p") == 1
        assert robot.device("b").configuration.find_group("G") == Bottle.parse("G (q bot)")
        (attach,) = robot.device("b").actions
        assert str(attach.location) == f"{bench.folder}/hw/deep/action.xml:1:1"

    def test_files_of_version_1(self, bench: Bench):
        """In version 1 the attribute ``file`` of any element includes a file, if such files are allowed."""
        old = DOCTYPE.replace("3.0//EN", "1.0//EN")
        main = self.write(
            bench,
            main=f'{old}<robot name="r" build="1" portprefix="/r"><devices file="hw.xml"/></robot>',
            hw=f"{old.replace('DOCTYPE robot', 'DOCTYPE devices')}<devices>{device('d')}</devices>",
        )
        reading = read_robot(main, allow_deprecated_dtd=True)
        assert [entry.name for entry in reading.robot.devices] == ["d"]
        assert reading.warnings == ()
        with pytest.raises(RobotFileError, match="version 1 of the format is deprecated"):
            read_robot(main)

    @pytest.mark.parametrize(
        ("tags", "names"),
        [
            ({}, "plain"),
            ({"enable_tags": Bottle(["a"])}, "plain a_or_b"),
            ({"enable_tags": "x b"}, "plain a_or_b"),
            ({"disable_tags": "c"}, ""),
            ({"enable_tags": "a", "disable_tags": "d"}, "plain"),
            ({"enable_all": ""}, "plain a_or_b"),
            ({"enable_tags": "enable_all"}, "plain a_or_b"),
        ],
    )
    def test_tags(self, bench: Bench, tags: dict[str, object], names: str):
        """An include is read if one of its tags is enabled and none of its tags is disabled."""
        main = self.write(
            bench,
            main=robot_xml(
                '<xi:include href="plain.xml" disabled_by="c"/>'
                '<xi:include href="a_or_b.xml" enabled_by="a b" disabled_by="c d"/>'
            ),
            plain=device("plain"),
            a_or_b=device("a_or_b"),
        )
        robot = read_robot(main, Property(tags)).robot
        assert " ".join(entry.name for entry in robot.devices) == names

    @pytest.mark.parametrize("href", ["../secret.xml", "/etc/passwd", "link.xml", "folder/secret.xml"])
    def test_nothing_outside_is_read(self, bench: Bench, href: str):
        """An include that leads out of the folder, also through a link, is refused."""
        bench.folder = bench.folder / "config"
        bench.folder.mkdir()
        secret = bench.folder.parent / "secret.xml"
        secret.write_text(device("secret"))
        (bench.folder / "link.xml").symlink_to(secret)
        (bench.folder / "folder").symlink_to(bench.folder.parent)
        (problem,) = problems(bench, f'<xi:include href="{href}"/>')
        assert problem.startswith(f"robot.xml:4:1: {href!r} is outside of the folder of the configuration, ")
        assert problem.endswith("copy the file into it; only files in it are read")

    def test_a_link_inside_is_read(self, bench: Bench):
        """A link to a file of the same folder is read."""
        main = self.write(bench, main=robot_xml('<xi:include href="link.xml"/>'), real=device("d"))
        (bench.folder / "link.xml").symlink_to("real.xml")
        assert read_robot(main).robot.device("d") is not None

    def test_circles_are_named(self, bench: Bench):
        """Files that include each other are an error that names them in order."""
        main = self.write(
            bench,
            main=robot_xml('<xi:include href="a.xml"/>'),
            a='<devices><xi:include href="b.xml"/></devices>',
            b='<devices><xi:include href="./a.xml"/></devices>',
        )
        with pytest.raises(RobotFileError, match=r"b\.xml:1:10: files include each other: a\.xml -> b\.xml -> a\.xml"):
            read_robot(main)

    def test_chains_are_bounded(self, bench: Bench):
        """A chain of includes without a circle is refused beyond a depth of 16."""
        links = {f"f{n}": f'<devices><xi:include href="f{n + 1}.xml"/></devices>' for n in range(30)}
        main = self.write(bench, main=robot_xml('<xi:include href="f0.xml"/>'), **links)
        with pytest.raises(RobotFileError, match="nested deeper than 16"):
            read_robot(main)

    def test_numbers_of_files_are_bounded(self, bench: Bench, monkeypatch: pytest.MonkeyPatch):
        """The number of included files is limited, so that files that double cannot fill the memory."""
        monkeypatch.setattr(includes, "MAX_FILES", 50)
        twice = '<xi:include href="f{}.xml"/>' * 2
        links = {f"f{n}": f"<devices>{twice.format(n + 1, n + 1)}</devices>" for n in range(12)}
        main = self.write(bench, main=robot_xml('<xi:include href="f0.xml"/>'), **links)
        with pytest.raises(RobotFileError, match="more than 50 files"):
            read_robot(main)

    def test_all_wrong_files_are_reported(self, bench: Bench):
        """One error reports a missing file, broken XML, a folder, an include without a path, and mistakes inside."""
        (bench.folder / "dir.xml").mkdir()
        (bench.folder / "bad.xml").write_text("<devices>\n<device")
        (bench.folder / "slip.xml").write_text('<device name="d"/>')
        found = problems(
            bench,
            "".join(f"<xi:include {one}/>\n" for one in ('href="no.xml"', 'href="bad.xml"', 'href="dir.xml"', ""))
            + '<xi:include href="slip.xml"/><xi:include href="a&#0;b"/>'.replace("&#0;", "b" * 300),
        )
        assert [one.split(": ")[0] for one in found] == [
            "robot.xml:4:1",
            "bad.xml:2:1",
            "robot.xml:6:1",
            "robot.xml:7:1",
            "robot.xml:8:30",
            "slip.xml:1:1",
        ]


class TestHostile:
    """Files that are made to harm the reader."""

    def refused(self, bench: Bench, text: str | bytes) -> str:
        """Return the message with which the reader refuses a text, without the path."""
        path = bench.folder / "hostile.xml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(ConfigurationError) as raised:
            read_robot(path)
        assert len(str(raised.value)) < 2000
        return str(raised.value).replace(f"{path}:", "")

    def test_entities_are_refused(self, bench: Bench):
        """A declared entity is refused by name, inner, external or parameter; an undefined one, too."""
        laughs = "".join(f'<!ENTITY l{n + 1} "{f"&l{n};" * 10}">' for n in range(9))
        bomb = f'<!DOCTYPE robot [<!ENTITY l0 "ha">{laughs}]><robot name="&l9;"/>'
        assert self.refused(bench, bomb).startswith("1:30: the file declares the entity 'l0'")
        secret = bench.folder / "secret"
        secret.write_text("secret")
        external = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "{secret}">]><robot name="&x;"/>'
        assert "declares the entity 'x'" in self.refused(bench, external)
        parameter = f'<!DOCTYPE robot [<!ENTITY % p SYSTEM "{secret}"> %p;]><robot name="x"/>'
        assert "declares the entity 'p'" in self.refused(bench, parameter)
        assert "undefined entity; write the character" in self.refused(bench, robot_xml("<params>&nobody;</params>"))
        assert "undefined entity" in self.refused(bench, '<robot name="&nobody;"/>')

    def test_sizes_are_bounded(self, bench: Bench, monkeypatch: pytest.MonkeyPatch):
        """Files, attributes, texts, depths and numbers of elements have a limit."""
        assert "an attribute of <robot> is longer" in self.refused(bench, f'<robot name="{"x" * 100_000}"/>')
        assert "a text is longer" in self.refused(bench, robot_xml(f'<param name="a">{"x" * 100_000}</param>'))
        assert "nested deeper than 64" in self.refused(bench, robot_xml("<devices>" * 100 + "</devices>" * 100))
        monkeypatch.setattr(xml_tree, "MAX_ELEMENTS", 1000)
        assert "more than 1000 elements" in self.refused(bench, robot_xml("<devices/>" * 2000))
        monkeypatch.setattr(xml_tree, "MAX_BYTES", 5000)
        assert "larger than" in self.refused(bench, robot_xml(" " * 5000))

    def test_numbers_are_bounded(self, bench: Bench):
        """Devices, actions and parameters of a robot have a greatest number."""
        assert "more than 1000 devices" in self.refused(bench, robot_xml("".join(device(f"d{n}") for n in range(1100))))
        assert "more than 10000 actions" in self.refused(
            bench, robot_xml(device("d", inside=action("detach") * 10_100))
        )
        shared = "".join(f'<param name="p{n}">1</param>' for n in range(1100))
        assert "more than 1000 parameters" in self.refused(
            bench, robot_xml(f"<devices>{shared}{device('d') * 1100}</devices>")
        )

    def test_many_mistakes_are_bounded(self, bench: Bench):
        """An error lists at most MAX_PROBLEMS problems."""
        path = bench.folder / "r.xml"
        path.write_text(robot_xml("<device/>" * 5000))
        with pytest.raises(RobotFileError) as raised:
            read_robot(path)
        assert len(raised.value.problems) == MAX_PROBLEMS

    @pytest.mark.parametrize(
        "data",
        [b"", b"\0", b"\xff\xfe<\0", b"<robot", b"text", b"<?xml version='1.0' encoding='klingon'?><robot/>", b"\xff"],
    )
    def test_what_is_no_xml(self, bench: Bench, data: bytes):
        """Bytes that are not XML are refused with an error of the configuration."""
        assert self.refused(bench, data)

    def test_dashes_in_comments_are_forgiven(self, bench: Bench):
        """Double dashes in comments, as in old files, are accepted, and places stay right."""
        (problem,) = problems(bench, "<!-- one -- two --- -->\n<!----><what/>")
        assert problem.startswith("robot.xml:5:8: <what>")

    def test_control_characters_in_names(self, bench: Bench):
        """A name with control characters is refused, and the message is printable."""
        (problem,) = problems(bench, '<device name="a&#x9b;31m" type="t"/>')
        assert "is not a valid name" in problem
        assert problem.isprintable()

    def test_a_pipe_is_no_file(self, bench: Bench):
        """An include of a pipe is refused, instead of waiting for data."""
        import os

        os.mkfifo(bench.folder / "pipe.xml")
        (problem,) = problems(bench, '<xi:include href="pipe.xml"/>')
        assert "cannot be read" in problem

    def test_a_file_that_is_missing(self, bench: Bench):
        """A missing main file is an error that names it."""
        with pytest.raises(RobotFileError, match=r"nothing\.xml cannot be read"):
            read_robot(bench.folder / "nothing.xml")

    def test_document_types_are_not_followed(self, bench: Bench):
        """The address in a document type is not opened, and a subset without entities is accepted."""
        path = bench.folder / "r.xml"
        path.write_text(
            DOCTYPE.replace('.dtd">', '.dtd" [<!ELEMENT robot ANY>]>') + '<robot name="r" build="1" portprefix="/r"/>'
        )
        assert read_robot(path).robot.name == "r"
