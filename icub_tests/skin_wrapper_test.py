"""Skin wrapper: the server of an analog sensor opens its ports, refuses names in use, and closes all ports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property
from rtf.clock import SystemClock
from rtf.middleware.ports import remote
from rtf.middleware.ports.network import default_network
from rtf.middleware.ports.port import Port
from rtf.middleware.wire.contact import Contact
from rtf.robot.errors import DeviceError
from rtf.robot.sensors.skin_wrapper import SkinWrapper
from rtf.robot_testing.judging.failure_causes import likely_causes
from rtf.robot_testing.streams.port_recorder import Listener
from rtf.testing import Parameter, TestCase

if TYPE_CHECKING:
    from collections.abc import Mapping

_RPC = "/rpc:i"
_PARTS = ("left_hand", "left_forearm", "left_arm")
#: Least share of the messages that has to arrive: a loaded machine is slow, a wrong server sends next to nothing. And
#: the number of messages beyond the expected one: the first one, and one on the edge.
_LEAST, _BESIDE = 0.2, 2


class SkinWrapperTest(TestCase):
    """Opens the wrapper of a skin in this process, with one port and with several. It needs a name server, no robot."""

    aliases = ("skinWrapperTest", "skin-wrapper", "skinWrapper")
    tags = ("devices",)

    prefix = Parameter(str, "the prefix of its port names", default="/testSkinWrapper")
    taxels = Parameter(int, "channels of the skin", default=10, low=len(_PARTS), high=1000)
    period = Parameter(float, "the period of its messages", unit="ms", default=20.0, low=1.0)
    time = Parameter(float, "how long it is recorded", unit="s", default=0.5, low=0.1)

    def setup(self) -> None:
        """Find the name server, and check that the names are free."""
        self.network, self.clock = default_network(), SystemClock()
        for name in (self._name("one"), self._name("parts")):
            self.assert_error_if_true(self._there(name), f"{name} is in use; give another prefix")

    def _name(self, which: str) -> str:
        return f"{self.prefix}/{which}/skin"

    def _there(self, name: str) -> bool:
        return remote.exists(self.network, Contact(name))

    def run(self) -> None:
        """One case after the other."""
        whole = {"name": self._name("one")}
        shares = {
            "name": self._name("parts"),
            "ports": Bottle(_PARTS),
            **{part: Bottle([channel, channel, channel, channel]) for channel, part in enumerate(_PARTS)},
        }
        self._test("one port", whole, [self._name("one"), f"{self._name('one')}{_RPC}"])
        several = [f"{self._name('parts')}/{part}" for part in _PARTS]
        self._test("several ports", shares, [*several, *(f"{part}{_RPC}" for part in several)])

    def _test(self, subject: str, configuration: Mapping[str, object], ports: list[str]) -> None:
        with self.subresult(subject):
            opened = self.clock.now()
            wrapper = self._open(configuration)
            try:
                for port in ports:
                    self.check_fail_if_false(self._there(port), f"{port} does not exist though the wrapper is open")
                self._listen([port for port in ports if not port.endswith(_RPC)], opened)
                self._check_refused(configuration, ports[0], "while another wrapper has it")
            finally:
                wrapper.close()
            for port in ports:
                self.check_fail_if_true(self._there(port), f"{port} still exists though the wrapper is closed")
                known = self.network.names.query(port)
                self.check_fail_if_true(known, f"{port} is still registered at the name server, at {known}")
        for port in (ports[0], ports[-1]):
            with self.subresult(f"{subject}, {port} taken"), Port(port, network=self.network):
                self._check_refused(configuration, port, "though it is in use")
                self.check(self._there(port), f"{port} still belongs to its first owner")

    def _open(self, configuration: Mapping[str, object]) -> SkinWrapper:
        wrapper = SkinWrapper("wrapper", network=self.network)
        skin = {"subdevice": "fakeAnalogSensor", "total_taxels": self.taxels}
        wrapper.open(Property({**configuration, **skin, "period": self.period}))
        return wrapper

    def _check_refused(self, configuration: Mapping[str, object], port: str, when: str) -> None:
        try:
            wrapper = self._open(configuration)
        except DeviceError as error:
            self.check(condition=True, text=f"refused: {error}")
        else:
            wrapper.close()
            self.check(condition=False, text=f"a wrapper took {port} {when}")

    def _listen(self, ports: list[str], opened: float) -> None:
        """Check that each port publishes, and not more than expected since ``opened``.

        Messages also arrive while the connections of the other ports are made, which takes time on a loaded machine.
        """
        with Listener(self.network, self.clock) as listener:
            recorders = [listener.add(port) for port in ports]
            listener.listen(self.time)
        passed = self.clock.now() - opened
        wanted, most = (seconds * 1e3 / self.period for seconds in (self.time, passed))
        for port, recorder in zip(ports, recorders, strict=True):
            came = len(recorder.messages)
            cause = likely_causes("slow" if came < wanted else "duplicate")
            hint = (
                f"{port} sends {came} messages in {self.time:g} s, {passed:.2f} s after the wrapper was opened, with a "
                f"period of {self.period:g} ms; {cause}"
            )
            self.measure(f"messages of {port}", came, "count", _LEAST * wanted, most + _BESIDE, hint=hint)
