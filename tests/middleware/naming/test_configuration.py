"""The files and variables that name the server and rename ports."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf.middleware.errors import AddressError, ConnectError, MiddlewareError
from rtf.middleware.naming import configuration
from rtf.middleware.naming.client import RemoteNames
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.naming.multi_server import MultiServerNames
from rtf.middleware.naming.server import NameServer
from rtf.middleware.ports.network import Network, Opening, default_network, set_default_network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact

if TYPE_CHECKING:
    from pathlib import Path

ROOT = Contact("/root", "10.0.0.5", 10500, "tcp")


@pytest.fixture
def home(tmp_path: Path) -> dict[str, str]:
    """An environment whose folder of configuration does not exist yet."""
    return {"YARP_CONFIG_HOME": str(tmp_path / "yarp")}


def write(environment: dict[str, str], name: str, text: str) -> None:
    """Write a file into the folder of configuration."""
    path = configuration.config_home(environment) / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


class TestFolder:
    """The folder of configuration."""

    def test_by_three_variables(self, tmp_path: Path):
        """The folder is that of YARP_CONFIG_HOME, XDG_CONFIG_HOME or HOME, in this order."""
        environment = {"HOME": "/h", "XDG_CONFIG_HOME": "/x", "YARP_CONFIG_HOME": "/y"}
        for variable, path in ("YARP_CONFIG_HOME", "/y"), ("XDG_CONFIG_HOME", "/x/yarp"), ("HOME", "/h/.config/yarp"):
            assert str(configuration.config_home(environment)) == path
            del environment[variable]
        with pytest.raises(MiddlewareError, match="set YARP_CONFIG_HOME or HOME"):
            configuration.config_home(environment)


class TestNamespaces:
    """The namespaces, of which each has a server."""

    def test_by_variable_file_or_default(self, home: dict[str, str]):
        """Namespaces are those of the variable, else of the file, else /root; several may be listed."""
        assert configuration.namespaces(home) == ["/root"]
        write(home, "yarp_namespace.conf", "/icub\n")
        assert configuration.namespaces(home) == ["/icub"]
        write(home, "yarp_namespace.conf", "(name /icub /other)")
        assert configuration.namespaces(home) == ["/icub", "/other"]
        write(home, "mine.conf", "/mine")
        assert configuration.namespaces({**home, "YARP_CONFIG_NAMESPACE_FILENAME": "mine.conf"}) == ["/mine"]
        assert configuration.namespaces({**home, "YARP_NAMESPACE": "/a /b"}) == ["/a", "/b"]

    def test_have_files(self, home: dict[str, str]):
        """Each namespace has a contact file with its name; that of /root is yarp.conf."""
        names = {ns: configuration.contact_file(ns, home).name for ns in ("", "/root", "/icub", "/my/robot-1")}
        assert names == {
            "": "yarp.conf",
            "/root": "yarp.conf",
            "/icub": "_icub.conf",
            "/my/robot-1": "_my_robot_1.conf",
        }


class TestContactFile:
    """The file with the address of the server."""

    def test_is_written_and_read(self, home: dict[str, str]):
        """The file has YARP's format, can be read again, and can be removed repeatedly."""
        assert configuration.read_place("", home) is None
        path = configuration.write_place(ROOT, environment=home)
        assert path.read_text() == "10.0.0.5 10500 yarp\n"
        assert configuration.read_place("", home) == configuration.Place(ROOT, "yarp")
        assert [found.name for found in path.parent.iterdir()] == ["yarp.conf"]
        for _ in range(2):
            assert configuration.remove_place("", home) == path
        assert configuration.read_place("", home) is None

    @pytest.mark.parametrize(
        ("text", "mode"),
        [
            ("10.0.0.5 10500", "yarp"),
            ("10.0.0.5  10500 local \n", "local"),
            ("[/root]\nhost 10.0.0.5\nport 10500\n", "yarp"),
            ("[/root]\nhost 10.0.0.5\nport 10500\nmode local\n", "local"),
            ("[name]\nhost 10.0.0.5\nport 10500\n", "yarp"),
            ("[/other]\nhost 1.1.1.1\nport 1\n\n[/root]\nport 10500\nhost 10.0.0.5\n", "yarp"),
        ],
    )
    def test_has_two_forms(self, home: dict[str, str], text: str, mode: str):
        """The file has one line, or a section."""
        write(home, "yarp.conf", text)
        assert configuration.read_place("", home) == configuration.Place(ROOT, mode)

    @pytest.mark.parametrize(
        "text", ["here", "10.0.0.5 x", "10.0.0.5 0", "10.0.0.5 70000 yarp", "[/b]\nhost a\nport 5", "["]
    )
    def test_that_says_nothing_useful(self, home: dict[str, str], text: str):
        """An invalid file is named, with the command that removes it."""
        write(home, "yarp.conf", text)
        with pytest.raises(AddressError, match=r"yarp\.conf .*rtf conf --clean"):
            configuration.read_place("", home)

    def test_that_cannot_be_read_or_written(self, home: dict[str, str], tmp_path: Path):
        """A file that cannot be read, written or removed is named."""
        (tmp_path / "yarp" / "yarp.conf").mkdir(parents=True)
        with pytest.raises(MiddlewareError, match=r"yarp\.conf cannot be read"):
            configuration.read_place("", home)
        with pytest.raises(MiddlewareError, match=r"yarp\.conf cannot be written"):
            configuration.write_place(ROOT, environment=home)
        with pytest.raises(MiddlewareError, match=r"yarp\.conf cannot be removed"):
            configuration.remove_place("", home)
        assert [path.name for path in (tmp_path / "yarp").iterdir()] == ["yarp.conf"]

    @pytest.mark.fuzz
    @settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.binary(max_size=200) | st.text(alphabet="[]/root \nhostpem 0123456789.", max_size=60).map(str.encode))
    def test_with_anything_in_it(self, home: dict[str, str], data: bytes):
        """A file with any bytes is read, or raises AddressError."""
        path = configuration.contact_file("/root", home)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        try:
            place = configuration.read_place("/root", home)
        except AddressError:
            return
        assert place is None or place.contact.valid


class TestPorts:
    """Prefixes, new names and numbers of ports."""

    def test_prefix_rename_and_number(self):
        """Variables set prefix, name and number; a renamed port has the prefix, too, a nameless one has not."""
        environment = {
            "YARP_PORT_PREFIX": "/lab",
            "YARP_RENAME_my_port_o": "/your/port",
            "YARP_PORTNUMBER_my_port_o": "12345",
        }
        assert configuration.opening(environment, "/my/port:o") == Opening("/lab/your/port", 12345)
        assert configuration.opening(environment, "/x") == Opening("/lab/x")
        assert configuration.opening(environment, "") == Opening("")
        assert configuration.opening({}, "/x") == Opening("/x")

    @pytest.mark.parametrize("number", ["x", "0", "-1", "70000", "1.5", "²"])
    def test_numbers_that_are_none(self, number: str):
        """The error about an invalid number names its variable."""
        with pytest.raises(AddressError, match="YARP_PORTNUMBER_a"):
            configuration.opening({"YARP_PORTNUMBER_a": number}, "/a")
        with pytest.raises(AddressError, match="YARP_PORT_RANGE"):
            configuration.base_port({"YARP_PORT_RANGE": number})


class TestNetwork:
    """The network that the configuration describes."""

    def test_of_the_file(self, home: dict[str, str]):
        """Names are found at the server of the contact file, or in the process with the mode ``local``."""
        with NameServer() as server:
            configuration.write_place(server.contact, environment=home)
            network = configuration.find_network({**home, "YARP_PORT_PREFIX": "/lab"})
            with Port("/a", network=network) as port:
                assert server.names.query("/lab/a") == port.contact
            assert server.names.query("/lab/a") is None
            network.names.close()
        configuration.write_place(server.contact, "local", home)
        assert isinstance(configuration.find_names(home), LocalNames)
        configuration.write_place(server.contact, "ros", home)
        with pytest.raises(ConnectError, match=r"yarp\.conf .*'ros'"):
            configuration.find_names(home)

    def test_without_a_file(self, home: dict[str, str]):
        """Without a file the server is on this machine, at port 10000 or YARP_PORT_RANGE."""
        for environment, number in (home, 10000), ({**home, "YARP_PORT_RANGE": "23456"}, 23456):
            names = configuration.find_names(environment)
            assert isinstance(names, RemoteNames)
            assert names.contact == Contact("/root", "127.0.0.1", number, "tcp")

    def test_of_several_namespaces(self, home: dict[str, str]):
        """With several namespaces a name is registered at all their servers."""
        environment = {**home, "YARP_NAMESPACE": "/one /two"}
        with NameServer(namespace="/one") as one, NameServer(namespace="/two") as two:
            for server in one, two:
                configuration.write_place(server.contact, environment=environment)
            names = configuration.find_names(environment)
            assert isinstance(names, MultiServerNames)
            names.register("/a", host="127.0.0.1", port=20001)
            assert one.names.query("/a") == two.names.query("/a") == Contact("/a", "127.0.0.1", 20001, "tcp")
            names.close()

    def test_by_another_address(self, home: dict[str, str]):
        """YARP_IP chooses the address of this machine, and one that it does not have is an error."""
        with NameServer() as server:
            configuration.write_place(server.contact, environment=home)
            names = configuration.find_names({**home, "YARP_IP": "127."})
            assert names.register("/a").host == "127.0.0.1"
            names.close()
        with pytest.raises(AddressError, match=r"YARP_IP is 203\.0"):
            configuration.find_names({**home, "YARP_IP": "203.0"})

    def test_of_the_process(self, home: dict[str, str], monkeypatch: pytest.MonkeyPatch):
        """The default network is made when it is first needed, and can be set."""
        for variable in ("YARP_NAMESPACE", "YARP_IP", "YARP_PORT_PREFIX"):
            monkeypatch.delenv(variable, raising=False)
        monkeypatch.setenv("YARP_CONFIG_HOME", home["YARP_CONFIG_HOME"])
        configuration.write_place(ROOT)
        set_default_network(None)
        try:
            network = default_network()
            assert network.names.contact == ROOT
            assert default_network() is network
            mine = Network(LocalNames())
            set_default_network(mine)
            assert default_network() is mine
        finally:
            set_default_network(None)
